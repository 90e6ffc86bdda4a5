// Looks at a page from inside a frame and writes what is wrong with it into the page around: what is wider than its box, cut, or drawn over another label.
(function () {
  var errors = [];
  window.addEventListener("error", function (e) { errors.push("script error: " + e.message); });
  function each(list, f) { Array.prototype.forEach.call(list, f); }
  function look() {
    var d = document, root = d.documentElement, out = errors;
    function say(what, e) {
      var name = typeof e.className === "string" ? e.className : e.getAttribute("class");
      out.push(what + ": " + e.tagName + "." + name + " " + (e.textContent || "").trim().slice(0, 60).replace(/\s+/g, " "));
    }
    if (root.scrollWidth > root.clientWidth) out.push("the page is " + root.scrollWidth + " px wide in " + root.clientWidth);
    each(d.querySelectorAll("section[id],.card,figure,table,pre,p,h1,h2,nav,svg,dl,button,label"), function (e) {
      var r = e.getBoundingClientRect(), box = e.parentElement.closest("section[id],.card,main,footer,body");
      if (!r.width || !box) return;
      var b = box.getBoundingClientRect();
      if (r.right > b.right + 1 || r.left < b.left - 1) say("wider than its box by " + Math.round(Math.max(r.right - b.right, b.left - r.left)), e);
    });
    each(d.querySelectorAll(".scroll"), function (e) {
      if (e.scrollWidth > e.clientWidth + 1) say("cut by " + (e.scrollWidth - e.clientWidth), e);
    });
    each(d.querySelectorAll("svg"), function (s) {
      var box = s.getBoundingClientRect();
      if (!box.width) return;
      var all = Array.prototype.filter.call(s.querySelectorAll("text"), function (t) { return t.getBoundingClientRect().width > 0; });
      all.forEach(function (t, i) {
        var a = t.getBoundingClientRect();
        if (a.left < box.left - 1 || a.right > box.right + 1) say("label outside its picture", t);
        all.slice(i + 1).forEach(function (u) {
          var b = u.getBoundingClientRect(), w = Math.min(a.right, b.right) - Math.max(a.left, b.left), h = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
          // Boxes of letters have air around them: a touch of it is no overlap.
          if (w > 1.5 && h > 3) say("label over \"" + u.textContent + "\"", t);
        });
      });
    });
    var said = parent.document.createElement("pre");
    said.id = "probe";
    said.textContent = "PROBE " + innerWidth + " " + (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light") + " " +
      d.querySelectorAll("svg text").length + "\n" + out.join("\n") + "\nEND";
    parent.document.body.appendChild(said);
  }
  window.addEventListener("load", function () { setTimeout(look, 200); });
})();

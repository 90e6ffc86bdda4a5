// Points at the middle of the first picture (Bode), counts the marks on the Nyquist curve, points there, counts those in the Bode plot, and leaves.
window.addEventListener("load", function () {
  function wide(title) {
    return Array.prototype.filter.call(document.querySelectorAll("figure.fig"), function (f) { return f.querySelector("figcaption").textContent.indexOf(title) >= 0; })[0].querySelector(".wide svg");
  }
  function point(svg, x, y, what) {
    svg.dispatchEvent(new PointerEvent(what || "pointermove", { clientX: x, clientY: y, pointerId: 1, pointerType: "mouse", bubbles: true }));
  }
  var bode = wide("Open loop"), plane = wide("Nyquist"), area = bode.querySelector("g.panel .frame").getBoundingClientRect();
  bode.scrollIntoView();
  area = bode.querySelector("g.panel .frame").getBoundingClientRect();
  point(bode, area.left + 0.55 * area.width, area.top + 0.5 * area.height);
  var marks = plane.querySelectorAll(".over .link"), said = "nyquist " + marks.length;
  plane.scrollIntoView();
  var at = marks.length ? marks[0].getBoundingClientRect() : { left: 0, top: 0, width: 0, height: 0 };
  point(plane, at.left + at.width / 2, at.top + at.height / 2);
  said += " bode " + bode.querySelectorAll(".over .link").length;
  point(plane, 0, 0, "pointerleave");
  said += " left " + document.querySelectorAll(".over .link").length;
  var out = document.createElement("pre");
  out.id = "linked";
  out.textContent = said;
  document.body.appendChild(out);
});

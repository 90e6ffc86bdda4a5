//! How wide a text is drawn, and a text cut to a width.

/// Estimated width of a text (px), rather too wide than too narrow, since the reader's font is not known.
pub(super) fn text_width(text: &str, font_px: f64) -> f64 {
    let em: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '|' | '\'' | '(' | ')' | '[' | ']' | ' ' | 't' | 'f' => 0.36,
            'm' | 'w' | 'M' | 'W' => 0.92,
            'A'..='Z' => 0.7,
            _ => 0.61,
        })
        .sum();
    em * font_px
}

/// The text, cut with an ellipsis where it is wider than the room for it (px).
pub(super) fn fitted(text: &str, font_px: f64, room: f64) -> String {
    if text_width(text, font_px) <= room {
        return text.to_owned();
    }
    let mut cut = String::new();
    let mut width = text_width("…", font_px);
    for c in text.chars() {
        width += text_width(c.encode_utf8(&mut [0; 4]), font_px);
        if width > room {
            break;
        }
        cut.push(c);
    }
    cut.push('…');
    cut
}

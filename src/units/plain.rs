//! Words from files as they may stand in any line: on a terminal, in YAML, CSV, code, a figure or a page.

use std::borrow::Cow;

/// What stands for a character that is left out.
const LEFT_OUT: char = char::REPLACEMENT_CHARACTER;

/// Controls (Unicode's Cc: escape, line ends, U+0085), separators of lines and paragraphs, and what turns the
/// direction of the words that follow (Unicode Standard Annex 9, explicit formatting and implicit marks).
fn acts(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A name, a unit or a sentence of a file: one line of characters that only show themselves.
pub fn plain(text: &str) -> Cow<'_, str> {
    match text.contains(acts) {
        true => text.replace(acts, LEFT_OUT.encode_utf8(&mut [0; 4])).into(),
        false => text.into(),
    }
}

/// The same for a text of lines, which keeps their ends and its tabs.
pub fn plain_lines(text: &str) -> Cow<'_, str> {
    let acts = |c: char| acts(c) && !matches!(c, '\n' | '\r' | '\t');
    match text.contains(acts) {
        true => text.replace(acts, LEFT_OUT.encode_utf8(&mut [0; 4])).into(),
        false => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_acts_is_left_out_and_nothing_else() {
        let acting = "\0\x07\x1b\n\r\t\x7f\u{80}\u{85}\u{9b}\u{61c}\u{200e}\u{200f}\u{2028}\u{2029}\u{202a}\u{202b}\u{202c}\u{202d}\u{202e}\u{2066}\u{2067}\u{2068}\u{2069}";
        assert_eq!(plain(acting), acting.chars().map(|_| LEFT_OUT).collect::<String>());
        assert_eq!(plain_lines("a\r\n\tb\x1b[0m\u{2028}"), "a\r\n\tb\u{fffd}[0m\u{fffd}");
        let words = "gyro_x (°/s) √Hz – µ 角速度 гиро";
        assert!(matches!(plain(words), Cow::Borrowed(same) if same == words));
    }
}

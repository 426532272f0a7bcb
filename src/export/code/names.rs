//! Names and numbers as the languages want them.

/// Small letters, digits and underscores, for a part of a name.
pub(super) fn identifier(text: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    text.trim().chars().map(plain).collect()
}

/// The name, with a number behind it when it is among the `taken`, which it joins.
pub(super) fn unique(name: &str, taken: &mut Vec<String>) -> String {
    let mut candidate = name.to_owned();
    let mut count = 1;
    while taken.contains(&candidate) {
        count += 1;
        candidate = format!("{name}_{count}");
    }
    taken.push(candidate.clone());
    candidate
}

/// Text that ends no comment, begins none and means nothing to a compiler.
pub(super) fn comment(text: &str) -> String {
    let plain = |c: char| if c == ' ' || c.is_ascii_graphic() && c != '\\' { c } else { '?' };
    let text: String = text.chars().map(plain).collect();
    text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
}

/// The shortest number that reads back to the same value of its precision.
pub(super) fn number(value: f64, float: bool) -> String {
    if float { format!("{:?}", value as f32) } else { format!("{value:?}") }
}

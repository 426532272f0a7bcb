//! JSON with one row of a matrix per line: lists of plain values stay on one line, everything else is indented.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::{Formatter, Serializer};

/// Pretty JSON with a trailing newline.
pub(crate) fn to_string<T: Serialize>(value: &T) -> String {
    let mut bytes = Vec::new();
    let mut serializer = Serializer::with_formatter(&mut bytes, Rows::default());
    // Writing to memory fails only for maps whose keys are not text, which no document has.
    let written = value.serialize(&mut serializer).is_ok();
    bytes.push(b'\n');
    if written { String::from_utf8(bytes).unwrap_or_default() } else { String::new() }
}

#[derive(Default)]
struct Rows {
    depth: usize,
    /// An element was announced and its kind is not known yet; true for the first of its list.
    announced: Option<bool>,
    /// For every open list: whether it went over several lines.
    broken: Vec<bool>,
}

impl Rows {
    fn indent<W: ?Sized + Write>(&self, w: &mut W) -> io::Result<()> {
        w.write_all(b"\n")?;
        (0..self.depth).try_for_each(|_| w.write_all(b"  "))
    }

    /// A plain value follows: it stays on the line.
    fn plain<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        match self.announced.take() {
            Some(false) => w.write_all(b", "),
            _ => Ok(()),
        }
    }

    /// A list or an object follows: in a list it starts a line.
    fn compound<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        let Some(first) = self.announced.take() else { return Ok(()) };
        if !first {
            w.write_all(b",")?;
        }
        if let Some(broken) = self.broken.last_mut() {
            *broken = true;
        }
        self.indent(w)
    }
}

impl Formatter for Rows {
    fn write_null<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        self.plain(w)?;
        w.write_all(b"null")
    }
    fn write_bool<W: ?Sized + Write>(&mut self, w: &mut W, value: bool) -> io::Result<()> {
        self.plain(w)?;
        write!(w, "{value}")
    }
    fn write_i64<W: ?Sized + Write>(&mut self, w: &mut W, value: i64) -> io::Result<()> {
        self.plain(w)?;
        write!(w, "{value}")
    }
    fn write_u64<W: ?Sized + Write>(&mut self, w: &mut W, value: u64) -> io::Result<()> {
        self.plain(w)?;
        write!(w, "{value}")
    }
    fn write_f64<W: ?Sized + Write>(&mut self, w: &mut W, value: f64) -> io::Result<()> {
        self.plain(w)?;
        write!(w, "{value:?}") // the shortest text that reads back as the same number
    }
    fn begin_string<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        self.plain(w)?;
        w.write_all(b"\"")
    }
    fn begin_array<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        self.compound(w)?;
        self.depth += 1;
        self.broken.push(false);
        w.write_all(b"[")
    }
    fn begin_array_value<W: ?Sized + Write>(&mut self, _: &mut W, first: bool) -> io::Result<()> {
        self.announced = Some(first);
        Ok(())
    }
    fn end_array<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        self.depth = self.depth.saturating_sub(1);
        if self.broken.pop() == Some(true) {
            self.indent(w)?;
        }
        w.write_all(b"]")
    }
    fn begin_object<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        self.compound(w)?;
        self.depth += 1;
        w.write_all(b"{")
    }
    fn begin_object_key<W: ?Sized + Write>(&mut self, w: &mut W, first: bool) -> io::Result<()> {
        if !first {
            w.write_all(b",")?;
        }
        self.indent(w)
    }
    fn begin_object_value<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        w.write_all(b": ")
    }
    fn end_object<W: ?Sized + Write>(&mut self, w: &mut W) -> io::Result<()> {
        self.depth = self.depth.saturating_sub(1);
        self.indent(w)?;
        w.write_all(b"}")
    }
}

#[cfg(test)]
mod tests {
    use super::to_string;

    #[test]
    fn rows_stay_on_a_line_and_numbers_read_back() {
        let value = serde_json::json!({
            "F": [[1.0, 0.1], [0.0, 1e-300]], "G": [[], []], "a": [{"n": null, "t": [true, "x, \
                                                    \"y\""]}], "e": [], "o": {"u": -3},
        });
        let expected = r#"{
  "F": [
    [1.0, 0.1],
    [0.0, 1e-300]
  ],
  "G": [
    [],
    []
  ],
  "a": [
    {
      "n": null,
      "t": [true, "x, \"y\""]
    }
  ],
  "e": [],
  "o": {
    "u": -3
  }
}
"#;
        let text = to_string(&value);
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}

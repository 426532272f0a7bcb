//! Files that were written for other programs.

use crate::report::{Report, Section};

/// `test`: the command that checks generated code, in its folder.
pub fn export<'a>(files: &[String], test: Option<String>) -> Report<'a> {
    let written = files.iter().map(|file| format!("{file} written")).collect();
    let mut section = Section::new("").paragraphs(written);
    if let Some(test) = test {
        section = section.command("self-test, in that folder", test);
    }
    Report { title: "Export".into(), sections: vec![section], ..Report::default() }
}

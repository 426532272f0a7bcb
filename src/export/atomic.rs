//! Files that appear whole or not at all: a temporary file beside the target, renamed on success.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

#[derive(Debug, thiserror::Error)]
#[error("{path}: cannot write: {reason}")]
pub struct WriteError {
    pub path: String,
    pub reason: String,
}

impl WriteError {
    /// An error about this path, in the words given.
    pub fn new(path: &Path, reason: impl Into<String>) -> Self {
        WriteError { path: path.display().to_string(), reason: reason.into() }
    }
}

/// Write all bytes atomically.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|e| io_error(path, &e))?;
    file.commit()
}

/// Refuses to write over a file that is being read; a path that does not exist yet is equal to none.
pub fn refuse_input_as_output(output: &Path, input: &Path) -> Result<(), WriteError> {
    match (fs::canonicalize(output), fs::canonicalize(input)) {
        (Ok(output_file), Ok(input_file)) if output_file == input_file => {
            Err(WriteError::new(output, "it is the input file; give -o another name"))
        }
        _ => Ok(()),
    }
}

/// Says before the work what would be said after it: the output is the input file, or cannot be written. Nothing is left behind.
pub fn check_output(output: &Path, input: &Path) -> Result<(), WriteError> {
    refuse_input_as_output(output, input)?;
    // a pipe is not opened twice: its reader would take the first end for the only one
    if fs::metadata(output).map_or(true, |target| target.is_file()) {
        drop(AtomicFile::create(output)?);
    }
    Ok(())
}

/// A file in the making; nothing appears at its path before [`AtomicFile::commit`], and a dropped one leaves nothing behind.
///
/// A path that is no regular file (`/dev/null`, a pipe) is written directly: there is nothing to rename over.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    target: Target,
}

#[derive(Debug)]
enum Target {
    /// Temporary file and the place it will be moved to.
    Renamed(BufWriter<NamedTempFile>, PathBuf),
    Direct(BufWriter<File>),
}

const BUFFER: usize = 1 << 16;

impl AtomicFile {
    pub fn create(path: &Path) -> Result<AtomicFile, WriteError> {
        if path.as_os_str().is_empty() {
            return Err(WriteError::new(Path::new("''"), "the name of the output file is empty"));
        }
        let target = match fs::metadata(path) {
            Ok(found) if found.is_dir() => return Err(WriteError::new(path, "it is a folder")),
            Ok(found) if !found.is_file() => {
                let file = File::options().write(true).open(path).map_err(|e| io_error(path, &e))?;
                Target::Direct(BufWriter::with_capacity(BUFFER, file))
            }
            // a link is followed, so that the file it names is replaced and not the link
            Ok(_) => temporary(path, fs::canonicalize(path).map_err(|e| io_error(path, &e))?)?,
            Err(_) => temporary(path, path.to_path_buf())?,
        };
        Ok(AtomicFile { path: path.to_path_buf(), target })
    }

    /// The path asked for.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Overwrites bytes already written, then returns to the end.
    pub fn patch(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        match &mut self.target {
            Target::Renamed(file, _) => patch(file, offset, bytes),
            Target::Direct(file) => patch(file, offset, bytes),
        }
    }

    /// Moves the finished file to its place.
    pub fn commit(self) -> Result<(), WriteError> {
        let path = self.path;
        match self.target {
            Target::Direct(mut file) => file.flush().map_err(|e| io_error(&path, &e)),
            Target::Renamed(file, place) => {
                let file = file.into_inner().map_err(|e| io_error(&path, e.error()))?;
                file.persist(&place).map(|_| ()).map_err(|e| io_error(&path, &e.error))
            }
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.target {
            Target::Renamed(file, _) => file.write(bytes),
            Target::Direct(file) => file.write(bytes),
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        match &mut self.target {
            Target::Renamed(file, _) => file.flush(),
            Target::Direct(file) => file.flush(),
        }
    }
}

fn patch<F: Write + Seek>(file: &mut F, offset: u64, bytes: &[u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(offset))?;
    file.write_all(bytes)?;
    file.seek(SeekFrom::End(0)).map(|_| ())
}

fn temporary(path: &Path, place: PathBuf) -> Result<Target, WriteError> {
    let folder = place.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if fs::metadata(&place).is_ok_and(|m| m.permissions().readonly()) {
        return Err(WriteError::new(path, "the file is there and may not be written"));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".kfdesign-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // an ordinary file: the umask takes away what it takes from any other
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let file = builder.tempfile_in(folder).map_err(|e| io_error(path, &e))?;
    Ok(Target::Renamed(BufWriter::with_capacity(BUFFER, file), place))
}

/// The operating system's words, with the folder named where that is what is wrong.
pub(super) fn io_error(path: &Path, error: &io::Error) -> WriteError {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let reason = match error.kind() {
        ErrorKind::NotFound => format!("the folder '{}' does not exist", folder.display()),
        ErrorKind::PermissionDenied => format!("no permission to write in the folder '{}'", folder.display()),
        ErrorKind::NotADirectory => format!("'{}' is not a folder", folder.display()),
        // a temporary file's error carries its random name: keep the first words only
        _ => match error.raw_os_error() {
            Some(code) => io::Error::from_raw_os_error(code).to_string(),
            None => error.to_string(),
        },
    };
    WriteError::new(path, reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn the_file_appears_only_at_commit_and_replaces_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, "old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"new").unwrap();
        file.flush().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        file.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn a_dropped_file_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = AtomicFile::create(&folder.path().join("a")).unwrap();
        file.write_all(&vec![1u8; 1 << 18]).unwrap();
        drop(file);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_missing_folder_or_a_folder_as_target_is_one_clear_line() {
        let folder = tempfile::tempdir().unwrap();
        let error = write(&folder.path().join("no/where.csv"), b"").unwrap_err().to_string();
        assert!(error.contains("no' does not exist") && error.contains("where.csv: cannot write"), "{error}");
        assert!(!error.contains('\n'));
        let error = write(folder.path(), b"").unwrap_err().to_string();
        assert!(error.ends_with("it is a folder"), "{error}");
        fs::write(folder.path().join("file"), "").unwrap();
        let error = write(&folder.path().join("file/x"), b"").unwrap_err().to_string();
        assert!(error.contains("is not a folder") || error.contains("does not exist"), "{error}");
    }

    #[test]
    fn the_input_is_recognised_under_another_spelling() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log.csv");
        fs::write(&log, "1").unwrap();
        let detour = folder.path().join("x");
        fs::create_dir(&detour).unwrap();
        assert!(refuse_input_as_output(&detour.join("../log.csv"), &log).is_err());
        assert!(refuse_input_as_output(&folder.path().join("new.csv"), &log).is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_devices_written_directly_and_the_umask_obeyed() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, "old").unwrap();
        let ordinary = fs::metadata(&real).unwrap().permissions().mode();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write(&link, b"new").unwrap();
        assert_eq!(fs::read_to_string(&real).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&real).unwrap().permissions().mode(), ordinary);
        write(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}

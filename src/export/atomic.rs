//! Files that appear whole or not at all: a temporary file beside the target, on the disk before it is renamed.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempPath;

#[derive(Clone, Debug, thiserror::Error)]
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
            Err(WriteError::new(output, "it is the input file; give it another name"))
        }
        _ => Ok(()),
    }
}

/// Says before the work what would be said after it: the output cannot be written. Nothing is left behind.
pub fn check_output(output: &Path) -> Result<(), WriteError> {
    // a pipe is not opened twice: its reader would take the first end for the only one
    if fs::metadata(output).map_or(true, |target| target.is_file()) {
        drop(AtomicFile::create(output)?);
    }
    Ok(())
}

/// The temporary files that are there now. Held while one is made, moved or removed, so that who holds it knows them
/// all.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// For a process that ends at a signal: removes every temporary file and lets no other come to be, nor any reach its
/// place.
pub fn abandon() {
    let files = unfinished();
    files.iter().for_each(|file| drop(fs::remove_file(file)));
    // whoever wants to make or move one waits for the end
    std::mem::forget(files);
}

/// A temporary file's name; removed when dropped.
#[derive(Debug)]
struct Unfinished(Option<TempPath>);

impl Unfinished {
    fn create(builder: &mut tempfile::Builder<'_, '_>, folder: &Path) -> io::Result<(File, Unfinished)> {
        let mut all = unfinished();
        let (file, path) = builder.tempfile_in(folder)?.into_parts();
        all.push(path.to_path_buf());
        Ok((file, Unfinished(Some(path))))
    }

    fn persist(mut self, place: &Path) -> io::Result<()> {
        self.end(|path| path.persist(place).map_err(|e| e.error))
    }

    fn end(&mut self, how: impl FnOnce(TempPath) -> io::Result<()>) -> io::Result<()> {
        let mut all = unfinished();
        let Some(path) = self.0.take() else { return Ok(()) };
        all.retain(|other| *other != *path);
        how(path)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let _ = self.end(TempPath::close);
    }
}

/// A hidden file for as long as this is there; also a process that ends at a signal removes it.
#[derive(Debug)]
pub struct Scratch(Unfinished);

impl Scratch {
    /// In this folder; where that has no name, in the system's for such files.
    pub fn new(folder: &Path, content: &[u8]) -> Result<Scratch, WriteError> {
        let own = std::env::temp_dir();
        let folder = if folder.as_os_str().is_empty() { own.as_path() } else { folder };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".kfdesign-").suffix(".draft.json");
        let told = |error: io::Error| io_error(&folder.join("draft"), &error);
        let (mut file, name) = Unfinished::create(&mut builder, folder).map_err(told)?;
        file.write_all(content).map_err(told)?;
        Ok(Scratch(name))
    }

    pub fn path(&self) -> &Path {
        self.0.0.as_deref().unwrap_or(Path::new(""))
    }
}

/// A file in the making; nothing appears at its path before [`AtomicFile::commit`], and a dropped one leaves nothing
/// behind.
///
/// A path that is no regular file (`/dev/null`, a pipe) is written directly: there is nothing to rename over.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    target: Target,
}

#[derive(Debug)]
enum Target {
    /// Temporary file, its name, and the place it will be moved to.
    Renamed(BufWriter<File>, Unfinished, PathBuf),
    Direct(BufWriter<File>),
}

const BUFFER: usize = 1 << 16;
/// Links that lead to links, as many as Linux follows.
const MOST_LINKS: usize = 40;

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
            _ => temporary(path, place(path).ok_or_else(|| WriteError::new(path, "its links lead in a circle"))?)?,
        };
        Ok(AtomicFile { path: path.to_path_buf(), target })
    }

    /// The path asked for.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn file(&mut self) -> &mut BufWriter<File> {
        match &mut self.target {
            Target::Renamed(file, ..) | Target::Direct(file) => file,
        }
    }

    /// Overwrites bytes already written, then returns to the end.
    pub fn patch(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        let file = self.file();
        let patched = file
            .seek(SeekFrom::Start(offset))
            .and_then(|_| file.write_all(bytes))
            .and_then(|()| file.seek(SeekFrom::End(0)));
        patched.map(|_| ()).map_err(|e| self.told(&e))
    }

    /// Moves the finished file to its place, with the mode of the file that was there. It is on the disk before it
    /// has its name, so that also after a power failure the old file is there or the whole new one.
    pub fn commit(self) -> Result<(), WriteError> {
        let path = self.path;
        let done = match self.target {
            Target::Direct(mut file) => file.flush(),
            Target::Renamed(file, name, place) => file.into_inner().map_err(|e| e.into_error()).and_then(|file| {
                if let Ok(old) = fs::metadata(&place) {
                    // a file system without modes has none to keep
                    let _ = file.set_permissions(old.permissions());
                }
                file.sync_all()?;
                drop(file);
                name.persist(&place)?;
                // the new name is in the folder, which some file systems do not let be flushed
                let _ = File::open(folder_of(&place)).and_then(|folder| folder.sync_all());
                Ok(())
            }),
        };
        done.map_err(|e| io_error(&path, &e))
    }

    /// The error as one of the path that was asked for, in words.
    fn told(&self, error: &io::Error) -> io::Error {
        io::Error::new(error.kind(), io_error(&self.path, error))
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file().write(bytes).map_err(|e| self.told(&e))
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file().flush().map_err(|e| self.told(&e))
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where a file is or will be: links are followed, also to where nothing is yet. None where they never end.
pub fn place(path: &Path) -> Option<PathBuf> {
    let mut place = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&place) {
            Ok(target) => place = folder_of(&place).join(target),
            Err(_) => return Some(place),
        }
    }
    None
}

fn temporary(path: &Path, place: PathBuf) -> Result<Target, WriteError> {
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
    // where a link leads is told by its own folder
    let asked = if place == path { path } else { &place };
    let (file, name) = Unfinished::create(&mut builder, folder_of(&place))
        .map_err(|e| WriteError { path: path.display().to_string(), ..io_error(asked, &e) })?;
    Ok(Target::Renamed(BufWriter::with_capacity(BUFFER, file), name, place))
}

/// The error in words, with the folder named where that is what is wrong.
pub(super) fn io_error(path: &Path, error: &io::Error) -> WriteError {
    if let Some(told) = error.get_ref().and_then(|inner| inner.downcast_ref::<WriteError>()) {
        return told.clone();
    }
    let folder = folder_of(path).display();
    WriteError::new(
        path,
        match error.kind() {
            ErrorKind::NotFound => format!("the folder '{folder}' does not exist"),
            ErrorKind::PermissionDenied => format!("no permission to write in the folder '{folder}'"),
            ErrorKind::NotADirectory => format!("'{folder}' is not a folder"),
            _ => in_words(error),
        },
    )
}

/// What the operating system says of a write that failed, without its number, and without the random name that a
/// temporary file's error has.
pub fn in_words(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::StorageFull => "no space is left on the disk".into(),
        ErrorKind::QuotaExceeded => "the disk quota is used up".into(),
        ErrorKind::FileTooLarge => "the file is larger than it may be (ulimit -f)".into(),
        _ => {
            let inner = error.get_ref().and_then(|inner| inner.source()).and_then(|e| e.downcast_ref::<io::Error>());
            let text = inner.unwrap_or(error).to_string();
            text.split(" (os error").next().unwrap_or(&text).to_string()
        }
    }
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

    /// A link to a name without a file makes that file and stays a link; one that leads to itself, or into no
    /// folder, is told.
    #[cfg(unix)]
    #[test]
    fn a_link_to_nothing_is_followed() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("far")).unwrap();
        symlink("far/second", at("first")).unwrap();
        symlink("real", at("far/second")).unwrap();
        write(&at("first"), b"new").unwrap();
        assert_eq!(fs::read_to_string(at("far/real")).unwrap(), "new");
        assert!(fs::symlink_metadata(at("first")).unwrap().is_symlink());
        assert_eq!(names(&at("far")), ["real", "second"]);
        symlink("circle", at("circle")).unwrap();
        let error = write(&at("circle"), b"").unwrap_err().to_string();
        assert!(error.ends_with("circle: cannot write: its links lead in a circle"), "{error}");
        symlink("nowhere/x", at("lost")).unwrap();
        let error = write(&at("lost"), b"").unwrap_err().to_string();
        assert!(
            error.contains("lost: cannot write: the folder '") && error.ends_with("nowhere' does not exist"),
            "{error}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_replaced_file_keeps_its_mode() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        for mode in [0o600, 0o640, 0o755] {
            fs::write(&path, "old").unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            write(&path, b"new").unwrap();
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, mode);
        }
    }

    /// The system's own number and the name of the temporary file are no part of a message.
    #[test]
    fn errors_are_told_in_words_with_the_path_asked_for() {
        let path = Path::new("out/a.csv");
        let of = |code| io_error(path, &io::Error::from_raw_os_error(code)).to_string();
        if cfg!(target_os = "linux") {
            assert_eq!(of(28), "out/a.csv: cannot write: no space is left on the disk");
            assert_eq!(of(122), "out/a.csv: cannot write: the disk quota is used up");
            assert_eq!(of(5), "out/a.csv: cannot write: Input/output error");
        }
        let wrapped = io::Error::other(io_error(path, &ErrorKind::StorageFull.into()));
        assert_eq!(
            io_error(Path::new("other"), &wrapped).to_string(),
            "out/a.csv: cannot write: no space is left on the disk"
        );
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

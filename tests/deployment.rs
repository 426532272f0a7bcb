//! The files of docs/cluster and docs/ci are run, so that they cannot rot: the Kubernetes containers' scripts, and
//! the CI files' commands. Slurm's scripts are checked on a real Slurm by `.ci/slurm`.

use std::path::Path;
use std::process::Command;

use crate::support::{Bench, data};

/// A file below docs/.
fn doc(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name)).unwrap()
}

/// A directory with filter.json, tuned from the shipped parameters.
fn tuned() -> Bench {
    let bench = Bench::new();
    std::fs::copy(data("params.json"), bench.path("params.json")).unwrap();
    bench.ok("tune params.json -o filter.json");
    bench
}

/// The script of a container: the block below `- name: NAME` that starts with `- |`.
fn container_script(yaml: &str, name: &str) -> String {
    let container = yaml.split(&format!("- name: {name}\n")).nth(1).unwrap();
    let block = container.split("- |\n").nth(1).unwrap();
    let indent = block.len() - block.trim_start().len();
    block
        .lines()
        .take_while(|line| line.len() > indent && line[..indent].trim().is_empty())
        .fold(String::new(), |script, line| script + &line[indent..] + "\n")
}

#[test]
fn kubernetes_shards_merge_to_the_document_of_one_process() {
    let yaml = doc("cluster/kubernetes/montecarlo.yaml");
    let bench = tuned();
    let folder = Path::new(env!("CARGO_BIN_EXE_kfdesign")).parent().unwrap();
    let path = std::env::join_paths(
        [folder.to_path_buf()].into_iter().chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    )
    .unwrap();
    let run = |script: &str, index: &str| {
        let out = Command::new("bash")
            .args(["-c", script])
            .current_dir(bench.path("."))
            .envs([("RUNS", "7"), ("SHARDS", "3"), ("OPTIONS", "--duration 100s --seed 1"), ("DESIGN", "filter.json")])
            .envs([("PATH", path.as_os_str()), ("JOB_COMPLETION_INDEX", index.as_ref())])
            .output()
            .unwrap();
        (out.status.code().unwrap(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    for index in ["0", "1", "2"] {
        let (status, stderr) = run(&container_script(&yaml, "shard"), index);
        assert_eq!(status, 0, "shard {index}: {stderr}");
    }
    let single = bench.run("montecarlo filter.json --runs 7 --duration 100s --seed 1 -o single.json");
    let (status, stderr) = run(&container_script(&yaml, "merge"), "");
    assert_eq!(status, single.status, "merge: {stderr}");
    assert!(status <= 1, "merge: {stderr}");
    assert_eq!(bench.read("montecarlo.json"), bench.read("single.json"));
}

/// Only that the commands are understood and write what the file publishes; the verdict is the gate's own matter.
#[test]
fn the_commands_of_the_ci_files_write_the_files_that_are_published() {
    for (file, prefix) in [("ci/github-actions.yml", "run: "), ("ci/gitlab-ci.yml", "- ")] {
        let yaml = doc(file);
        let bench = tuned();
        let mut commands = 0;
        for line in yaml.lines().filter_map(|l| l.trim().strip_prefix(prefix)) {
            let Some(arguments) = line.strip_prefix("kfdesign ") else { continue };
            let small = if arguments.starts_with("montecarlo") { " --runs 4 --duration 100s" } else { "" };
            let out = bench.run(&format!("{arguments}{small}"));
            assert!(out.status == 0 || (out.status == 1 && !small.is_empty()), "{file}: {line}: {}", out.stderr);
            commands += 1;
        }
        assert_eq!(commands, 2, "{file}: the commands were not found");
        for name in ["filter.json", "montecarlo.xml", "montecarlo.html"] {
            assert!(yaml.contains(name) && bench.path(name).exists(), "{file}: {name} is not written");
        }
    }
}

/// What cargo prints, offline: the package cache is there, since this test was built from it.
fn cargo(args: &str) -> String {
    let out = Command::new(env!("CARGO"))
        .args(args.split(' '))
        .arg("--offline")
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(out.status.success(), "cargo {args}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// What would be published: no log, no file of the workplace, the licences of what is linked.
#[test]
fn the_package_is_clean() {
    let list = cargo("package --list --allow-dirty");
    let files: Vec<&str> = list.lines().collect();
    for name in ["Cargo.lock", "LICENSE-APACHE", "LICENSE-MIT", "README.md", "docs/third-party-licences.md"] {
        assert!(files.contains(&name), "{name} is missing");
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in &files {
        let size = std::fs::metadata(root.join(name)).map_or(0, |file| file.len());
        assert!(size < 500_000, "{name}: {size} bytes");
        let made = [".cargo_vcs_info.json", "Cargo.toml.orig"].contains(name);
        assert!(made || !name.starts_with('.'), "{name} is of no use to who builds the package");
        assert!(![".tmp", ".part", ".orig", "~"].iter().any(|end| name.ends_with(end)) || made, "{name} is left over");
    }
}

/// docs/third-party-licences.md names every package that is linked into the program, in its version, and none that
/// Cargo.lock has not.
#[test]
fn third_party_licences_are_those_of_the_lock_file() {
    let page = doc("third-party-licences.md");
    let listed: std::collections::BTreeSet<&str> =
        page.lines().filter_map(|line| line.strip_prefix("- ")?.split(" (").next()).collect();
    let tree = cargo("tree --edges normal --prefix none --locked --format {p}");
    let linked = tree.lines().map(|line| line.trim_end_matches(" (*)").trim_end_matches(" (proc-macro)"));
    let linked: std::collections::BTreeSet<String> =
        linked.filter(|p| !p.starts_with("kfdesign ") && !p.is_empty()).map(|p| p.replacen(" v", " ", 1)).collect();
    let missing: Vec<&String> = linked.iter().filter(|package| !listed.contains(package.as_str())).collect();
    assert!(missing.is_empty(), "run the command at the top of the page: it lacks {missing:?}");
    let lock = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.lock")).unwrap();
    let locked = |package: &str| {
        let (name, version) = package.split_once(' ').unwrap();
        lock.contains(&format!("name = \"{name}\"\nversion = \"{version}\"\n"))
    };
    let gone: Vec<&str> = listed.into_iter().filter(|package| !locked(package)).collect();
    assert!(gone.is_empty(), "run the command at the top of the page: it still has {gone:?}");
}

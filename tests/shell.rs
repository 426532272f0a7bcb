//! Completion scripts and manual pages are made of the same definitions as the help, so they must know all that it
//! knows.

use std::process::Command;

use super::support::Bench;

/// Names of the commands, as `--help` lists them.
fn commands(bench: &Bench) -> Vec<String> {
    let help = bench.ok("--help");
    let listed = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    // a wrapped description is indented deeper
    let names: Vec<String> = listed
        .filter(|l| l.starts_with("  ") && !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next().map(String::from))
        .filter(|name| name != "help")
        .collect();
    assert!(names.len() >= 15 && names.contains(&"identify".into()), "{names:?}");
    names
}

/// Every `--flag` that a help text lists.
fn flags(help: &str) -> Vec<String> {
    let word = |l: &str| {
        let flag = l.trim_start().split_once("--")?;
        let before = flag.0.trim_end();
        let name: String = flag.1.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '-').collect();
        (before.is_empty() || (before.starts_with('-') && before.ends_with(','))).then(|| format!("--{name}"))
    };
    help.lines().filter_map(word).collect()
}

#[test]
fn every_shell_completes_every_command() {
    let bench = Bench::new();
    let names = commands(&bench);
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = bench.ok(&format!("completions {shell}"));
        for name in &names {
            assert!(script.contains(name.as_str()), "{shell}: {name}");
        }
        assert!(script.contains("correlation-time") || script.contains("temperature"), "{shell} knows no flags");
    }
    let refused = bench.run("completions tcsh");
    assert!(refused.status == 2 && refused.stderr.contains("bash, elvish, fish"), "{}", refused.stderr);
}

/// Bash reads the script, and what it then offers behind `kfdesign` and behind a flag of `identify` is what there is.
#[test]
fn bash_completes_commands_flags_and_values() {
    let bench = Bench::new();
    bench.file("completion", bench.ok("completions bash"));
    let bash = |script: &str| {
        let out = Command::new("bash").args(["--norc", "-c", script]).current_dir(bench.path(".")).output();
        let Ok(out) = out else {
            println!("skipped: there is no bash");
            return None;
        };
        assert!(out.status.success() && out.stderr.is_empty(), "{}", String::from_utf8_lossy(&out.stderr));
        Some(String::from_utf8_lossy(&out.stdout).into_owned())
    };
    if bash("bash -n completion").is_none() {
        return;
    }
    let offered = |line: &str| {
        let count = line.split(' ').count() - 1;
        let script = format!(
            "source ./completion; COMP_WORDS=({line} ''); COMP_WORDS=(${{COMP_WORDS[@]:0:{count}}} '{last}'); COMP_CWORD={count}; \
             _kfdesign kfdesign '{last}' '{before}'; printf '%s\\n' \"${{COMPREPLY[@]}}\"",
            last = line.rsplit(' ').next().unwrap_or_default(),
            before = line.rsplit(' ').nth(1).unwrap_or_default(),
        );
        bash(&script).unwrap_or_default()
    };
    assert_eq!(offered("kfdesign ident").trim(), "identify");
    assert_eq!(offered("kfdesign identify --temp").trim(), "--temperature");
    let methods = offered("kfdesign identify --method ");
    let methods: Vec<&str> = methods.split_whitespace().collect();
    assert_eq!(methods, ["graphical", "allan", "likelihood", "gmwm"]);
}

#[test]
fn every_command_has_a_manual_page_with_all_its_flags() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("man1")).unwrap();
    let names = commands(&bench);
    let said = bench.ok("man -o man1");
    assert_eq!(said, format!("{} pages in man1\n", names.len() + 1));
    let written = std::fs::read_dir(bench.path("man1")).unwrap().count();
    assert_eq!(written, names.len() + 1);
    for name in &names {
        let page = bench.read(&format!("man1/kfdesign-{name}.1")).replace("\\-", "-");
        let help = bench.ok(&format!("{name} --help"));
        let flags = flags(&help);
        assert!(flags.contains(&"--help".into()), "{name}: {flags:?}");
        for flag in flags {
            assert!(page.contains(&flag), "kfdesign-{name}.1 does not tell of {flag}");
        }
        let first = help.lines().next().unwrap().trim_end_matches('.');
        let words: Vec<&str> = first.split_whitespace().take(5).collect();
        assert!(
            page.replace('\n', " ").contains(&words.join(" ")),
            "kfdesign-{name}.1 does not say what it is: {first}"
        );
    }
    let main = bench.ok("man");
    assert_eq!(main, bench.read("man1/kfdesign.1"));
    for name in &names {
        assert!(main.replace("\\-", "-").contains(&format!("kfdesign-{name}(1)")), "{name}");
    }
    let refused = bench.run("man -o nowhere");
    assert!(
        refused.status == 2 && refused.stderr.contains("the folder 'nowhere' does not exist"),
        "{}",
        refused.stderr
    );
}

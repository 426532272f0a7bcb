//! The workbench in the browser: requests and command lines are the same thing; who may ask, and for which files. What
//! a browser does with it is tested in `tests/web`.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

use kfdesign::cli::{named, shell};
use kfdesign::ops::{
    airplane, allan, closed_loop, compare, datasheet, export, fly, identify, import, inflate, info, montecarlo, plan,
    replay, simulate, trim, tune,
};
use serde_json::{Value, json};

use crate::support::{Bench, data};

/// Every key of a schema with a value of its kind; those of groups stay in their group.
fn filled(root: &Value, schema: &Value) -> Value {
    let schema = match schema["$ref"].as_str() {
        Some(name) => root.pointer(name.trim_start_matches('#')).unwrap(),
        None => schema,
    };
    if let Some(keys) = schema["properties"].as_object() {
        return keys.iter().map(|(key, schema)| (key.clone(), filled(root, schema))).collect();
    }
    if let Some(any) = schema["anyOf"].as_array() {
        return filled(root, &any[0]);
    }
    let kind = schema["type"].as_array().map_or(&schema["type"], |kinds| &kinds[0]);
    match kind.as_str() {
        Some("boolean") => json!(true),
        Some("integer" | "number") => json!(3),
        Some("array") => json!([filled(root, &schema["items"])]),
        _ => json!("a"),
    }
}

#[test]
fn every_key_of_a_request_is_a_word_of_the_command_line() {
    macro_rules! all {
        ($($name:literal: $request:ty),* $(,)?) => {
            [$(($name, schemars::schema_for!($request).to_value())),*]
        };
    }
    let requests = all!(
        "airplane": airplane::Request, "allan": allan::Request, "loop": closed_loop::Request,
        "compare": compare::Request, "datasheet": datasheet::Request, "export": export::Request, "fly": fly::Request,
        "identify": identify::Request, "import": import::Request, "inflate": inflate::Request, "info": info::Request,
        "montecarlo": montecarlo::Request, "merge": montecarlo::merge::Request, "plan": plan::Request,
        "replay": replay::Request, "simulate": simulate::Request, "trim": trim::Request, "tune": tune::Request,
        "rank": tune::compare::Request,
    );
    for (name, schema) in requests {
        let request = filled(&schema, &schema);
        let words = shell::words(name, &request).unwrap_or_else(|error| panic!("{error}"));
        let mut keys = 0;
        fn count(value: &Value, keys: &mut usize) {
            value.as_object().unwrap().values().for_each(|value| match value {
                Value::Object(_) => count(value, keys),
                _ => *keys += 1,
            });
        }
        count(&request, &mut keys);
        // a flag has one word or two, an argument one
        assert!(words.len() > keys, "{name}: {keys} keys, {words:?}");
    }
    let error = shell::words("tune", &json!({ "params": "p.json", "nothing": 1 })).unwrap_err();
    assert_eq!(error, "nothing: tune has no such key");
    assert!(shell::words("schema2", &json!({})).unwrap_err().contains("no command"));
}

/// What a page asks for and what a person types gives the same bytes.
#[test]
fn a_request_and_its_command_line_give_the_same_document() {
    let bench = Bench::new();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    let at = |name: &str| bench.path(name).display().to_string();
    let same = |command: &str, request: Value| {
        let made = named::make(command, &request.to_string(), true).unwrap();
        let words = shell::words(command, &request).unwrap();
        let typed: Vec<&str> = words.iter().map(String::as_str).chain(["--json"]).collect();
        assert_eq!(bench.as_typed(&typed).stdout, made.json, "{}", shell::line(&words));
        made
    };
    let log = at("a log.npy");
    same("simulate", json!({ "params": at("params.json"), "output": log, "duration": "5min", "seed": 3 }));
    let reading = json!({ "columns": ["gyro_x", "gyro_y"], "start": "10s" });
    let made = same("identify", json!({ "logs": [log], "model": "white+gm", "reading": reading }));
    assert_eq!(made.shown("verdict").unwrap(), None);
    let plant = json!({ "plant": "angle", "aid": ["2 deg @ 1 Hz"] });
    let made = same("tune", json!({ "params": at("params.json"), "runs": 5, "plant": plant }));
    bench.file("filter.json", made.file.clone().unwrap());
    assert!(made.shown("figures").unwrap().unwrap().starts_with("<svg"));
    same("plan", json!({ "params": at("params.json"), "parameter": "white.density", "precision": "1%" }));
    // one that needs quotes in a shell
    let words = shell::words("info", &json!({ "log": log })).unwrap();
    assert_eq!(shell::line(&words), format!("kfdesign info '{log}'"));
}

/// A server on a folder, ended when this is dropped.
struct Server {
    child: Child,
    port: u16,
    token: String,
}

impl Server {
    fn start(folder: &std::path::Path, flags: &[&str]) -> Server {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kfdesign"));
        command.arg("serve").arg(folder).args(["--port", "0", "--no-open"]).args(flags);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let (_, rest) = line.trim().split_once("127.0.0.1:").unwrap();
        let (port, token) = rest.trim_end_matches('/').split_once('/').unwrap();
        let (port, token) = (port.parse().unwrap(), token.to_string());
        assert_eq!(token.len(), 48);
        Server { child, port, token }
    }

    /// Status and body of a request with these headers beside Host.
    fn raw(&self, method: &str, path: &str, headers: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        let length = if body.is_empty() { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
        let host = if headers.contains("Host:") { String::new() } else { format!("Host: 127.0.0.1:{}\r\n", self.port) };
        write!(stream, "{method} {path} HTTP/1.1\r\n{host}{headers}{length}Connection: close\r\n\r\n{body}").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let status = answer.split(' ').nth(1).unwrap().parse().unwrap();
        (status, answer.split_once("\r\n\r\n").map_or(String::new(), |(_, body)| body.to_string()))
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.raw("GET", &format!("/{}/{path}", self.token), "", "")
    }

    fn post(&self, path: &str, body: &Value) -> (u16, Value) {
        let headers = "Content-Type: application/json\r\n";
        let (status, body) = self.raw("POST", &format!("/{}/{path}", self.token), headers, &body.to_string());
        (status, serde_json::from_str(&body).unwrap_or_default())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn only_its_own_page_may_ask() {
    let bench = Bench::new();
    let server = Server::start(bench.path("").as_path(), &[]);
    let (port, token) = (server.port, &server.token);
    assert_eq!(server.get("api/project").0, 200);
    assert_eq!(server.get("").0, 200);
    let mut other = token.clone();
    other.replace_range(47..48, if other.ends_with('0') { "1" } else { "0" });
    for path in ["/", "/api/project", &format!("/{other}/api/project"), &format!("//{token}/api/project")] {
        assert_eq!(server.raw("GET", path, "", "").0, 404, "{path}");
    }
    let page = format!("/{token}/api/project");
    let ask = |headers: &str| server.raw("GET", &page, headers, "").0;
    for host in ["example.org", "127.0.0.1", "127.0.0.1:1", "localhost.example.org"] {
        assert_eq!(ask(&format!("Host: {host}\r\n")), 421, "{host}");
    }
    assert_eq!(ask(&format!("Host: 127.0.0.1:{port}\r\nHost: 127.0.0.1:{port}\r\n")), 421);
    assert_eq!(ask(&format!("Host: localhost:{port}\r\nOrigin: http://localhost:{port}\r\n")), 200);
    for headers in ["Origin: http://example.org\r\n", "Origin: null\r\n", "Sec-Fetch-Site: cross-site\r\n"] {
        assert_eq!(ask(headers), 403, "{headers}");
    }
    let post = |headers: &str| server.raw("POST", &format!("/{token}/api/jobs"), headers, "{}").0;
    assert_eq!(post("Content-Type: text/plain\r\n"), 415);
    assert_eq!(post(""), 415);
    assert_eq!(post("Content-Type: application/json\r\n"), 400);
    assert_eq!(server.raw("OPTIONS", &page, "", "").0, 405);
    // refused by what it says of itself: that body never comes
    let headers = "Content-Type: application/json\r\nContent-Length: 2147483648\r\n";
    assert_eq!(server.raw("POST", &format!("/{token}/api/jobs"), headers, "").0, 413);
}

/// One job at a time: the second waits with its draft, and both are stopped.
#[test]
fn a_stopped_job_leaves_nothing() {
    let bench = Bench::new();
    let params = std::fs::read(data("params.json")).unwrap();
    bench.file("params.json", &params);
    let server = Server::start(bench.path("").as_path(), &[]);
    let tune = |params: &str| json!({ "command": "tune", "request": { "params": params, "runs": 1_000_000_000 } });
    let mut waiting = tune("draft:p");
    waiting["drafts"] = json!({ "p": serde_json::from_slice::<Value>(&params).unwrap() });
    for job in [tune("params.json"), waiting] {
        assert_eq!(server.post("api/jobs", &job).0, 202);
    }
    assert_eq!(bench.files().len(), 2, "{:?}", bench.files());
    for id in [2, 1] {
        assert_eq!(server.raw("DELETE", &format!("/{}/api/jobs/{id}", server.token), "", "").0, 200);
    }
    assert_eq!(bench.files(), ["params.json"]);
    let ended = || server.get("api/jobs/1").1.contains("\"state\":\"stopped\"");
    while !ended() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    // the next one begins
    let info = json!({ "command": "plan", "request": { "params": "params.json", "parameter": "white.density", "precision": "1%" } });
    assert_eq!(server.post("api/jobs", &info).0, 202);
    while !server.get("api/jobs/3").1.contains("\"state\":\"done\"") {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

#[test]
fn a_request_names_files_of_the_folder_alone() {
    let bench = Bench::new();
    bench.file("secret.csv", "gyro_x (deg/s)\n1\n");
    std::fs::create_dir(bench.path("folder")).unwrap();
    bench.file("folder/params.json", std::fs::read(data("params.json")).unwrap());
    bench.file("folder/.hidden.csv", "gyro_x (deg/s)\n1\n");
    #[cfg(unix)]
    std::os::unix::fs::symlink(bench.path("secret.csv"), bench.path("folder/link.csv")).unwrap();
    let server = Server::start(&bench.path("folder"), &[]);
    let secret = bench.path("secret.csv").display().to_string();
    for name in ["../secret.csv", "./../secret.csv", ".hidden.csv", "link.csv", "/dev/zero", &secret] {
        let (status, said) = server.post("api/jobs", &json!({ "command": "info", "request": { "log": name } }));
        assert_eq!(status, 403, "{name}: {said}");
        let plant = json!({ "plant": "static", "accelerometer": format!("{name}:x") });
        let request = json!({ "params": "params.json", "plant": plant });
        assert_eq!(server.post("api/jobs", &json!({ "command": "tune", "request": request })).0, 403, "{name}");
        assert_eq!(server.post("api/save", &json!({ "name": name, "text": "x" })).0, 403, "{name}");
        assert_eq!(server.get(&format!("api/series?log={name}")).0, 403, "{name}");
        let draft = json!({ "airplane": name });
        let job = json!({ "command": "fly", "request": { "flight": "draft:f" }, "drafts": { "f": draft } });
        assert_eq!(server.post("api/jobs", &job).0, 403, "{name}");
    }
    // a topic is no file
    let reading = json!({ "topic": "/imu/data" });
    let request = json!({ "log": "none.bag", "reading": reading });
    assert_eq!(server.post("api/jobs", &json!({ "command": "allan", "request": request })).0, 202);
    assert_eq!(server.post("api/save", &json!({ "name": "new.json", "document": {} })).0, 200);
    assert_eq!(server.post("api/save", &json!({ "name": "new.json", "document": {} })).0, 409);
    let (_, project) = server.get("api/project");
    assert!(project.contains("params.json") && !project.contains("link.csv") && !project.contains("hidden"));
    // nothing is left of drafts
    assert_eq!(std::fs::read_dir(bench.path("folder")).unwrap().count(), 4);
}

#[test]
fn what_cannot_be_served_is_said_in_one_line() {
    let bench = Bench::new();
    bench.file("file", "");
    for (args, said) in [
        ("serve none --no-open", "none: there is no such folder; make it, or name another"),
        ("serve file --no-open", "file: is a file; name the folder that it is in"),
        ("serve . --no-open --idle 3deg", "--idle"),
        ("serve . --no-open --jobs 0", "--jobs"),
    ] {
        let out = bench.run(args);
        assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{args}: {}", out.stderr);
        assert!(out.stderr.contains(said), "{args}: {}", out.stderr);
    }
}

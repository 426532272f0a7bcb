//! Who may ask: this page, in this browser, on this machine.
//!
//! That a server listens on loopback alone protects nothing: any page in the browser can send requests there, and by a
//! name that it rebinds to 127.0.0.1 read the answers. So the address holds a secret, and the headers that a browser
//! writes and a page cannot must say that the request is the page's own.

use std::time::Duration;

use axum::body::{Body, HttpBody, to_bytes};
use axum::extract::Request;
use axum::http::header::{CONTENT_TYPE, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN};
use axum::http::{Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use rand::TryRng;
use rand::rngs::SysRng;

use super::Refused;

/// Bytes of a request; a document of 64 axes has a hundred thousand.
pub(super) const LARGEST_REQUEST: usize = 1 << 20;
/// Until a body, or the next part of an upload, must be there: on loopback a mebibyte takes milliseconds.
pub(super) const BODY_TIME: Duration = Duration::from_secs(10);
/// Of the secret: 192 bits cannot be guessed.
const BYTES: usize = 24;

/// The secret of an address.
#[derive(Clone)]
pub(super) struct Token(String);

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token")
    }
}

impl Token {
    /// From the system's random numbers.
    pub(super) fn new() -> Result<Token, String> {
        let mut bytes = [0u8; BYTES];
        SysRng.try_fill_bytes(&mut bytes).map_err(|error| format!("the system has no random numbers: {error}"))?;
        Ok(Token(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    pub(super) fn text(&self) -> &str {
        &self.0
    }

    /// Whether these are the same, in a time that does not tell how much of them is.
    fn is(&self, other: &str) -> bool {
        let differ = self.0.bytes().zip(other.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b));
        self.0.len() == other.len() && differ == 0
    }
}

/// Everything that is checked before a request is looked at.
#[derive(Clone, Debug)]
pub(super) struct Guard {
    pub(super) token: Token,
    pub(super) port: u16,
}

impl Guard {
    /// The path behind the token. Errors: the request is not the page's.
    fn check(&self, request: &Request) -> Result<String, Refused> {
        let headers = request.headers();
        let uri = request.uri();
        let hosts = ["127.0.0.1", "localhost", "[::1]"].map(|name| format!("{name}:{}", self.port));
        let one = |name: &HeaderName| {
            let mut all = headers.get_all(name).iter();
            (all.next(), all.next().is_none())
        };
        let ours = |value: &HeaderValue| value.to_str().is_ok_and(|host| hosts.iter().any(|own| own == host));
        match one(&HOST) {
            (Some(host), true) if ours(host) && uri.authority().is_none() => {}
            _ => return Err(Refused::new(StatusCode::MISDIRECTED_REQUEST, "this is not the server of that name")),
        }
        let (token, rest) = uri.path().trim_start_matches('/').split_once('/').unwrap_or_default();
        if !self.token.is(token) || !uri.path().starts_with(&format!("/{token}/")) {
            return Err(Refused::new(StatusCode::NOT_FOUND, "not found"));
        }
        let foreign = || Refused::forbidden("only the workbench's own page may ask".into());
        let origin = |value: &HeaderValue| {
            value.to_str().is_ok_and(|origin| hosts.iter().any(|own| origin.strip_prefix("http://") == Some(own)))
        };
        match one(&ORIGIN) {
            (None, _) => {}
            (Some(value), true) if origin(value) => {}
            _ => return Err(foreign()),
        }
        // typed into the address bar (none), or asked for by the page itself
        if headers.get_all("sec-fetch-site").iter().any(|site| site != "same-origin" && site != "none") {
            return Err(foreign());
        }
        let method = request.method();
        if ![Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::DELETE].contains(method) {
            return Err(Refused::new(StatusCode::METHOD_NOT_ALLOWED, "no such method"));
        }
        // a form of another page cannot say this without asking first, and nobody may ask
        let json = |headers: &HeaderMap| headers.get(CONTENT_TYPE).is_some_and(|kind| kind == "application/json");
        if method == Method::POST && !json(headers) {
            let error = "expected Content-Type: application/json";
            return Err(Refused::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, error));
        }
        Ok(format!("/{rest}"))
    }

    /// The request with its whole body: what is longer than it may be, or does not come, holds no connection.
    async fn whole(request: Request) -> Result<Request, Refused> {
        let (parts, body) = request.into_parts();
        let too_large = || Refused::new(StatusCode::PAYLOAD_TOO_LARGE, "a request has 1 MiB at most");
        // a little too much is read to its end, or the client would not hear the answer
        let most = 2 * LARGEST_REQUEST;
        if body.size_hint().lower() > most as u64 {
            return Err(too_large());
        }
        let late = |_| Refused::new(StatusCode::REQUEST_TIMEOUT, "the request did not come to its end");
        let body = tokio::time::timeout(BODY_TIME, to_bytes(body, most)).await.map_err(late)?;
        let body = body.ok().filter(|body| body.len() <= LARGEST_REQUEST).ok_or_else(too_large)?;
        Ok(Request::from_parts(parts, Body::from(body)))
    }

    /// The request without its token to who answers it; every answer with the headers that keep the page closed.
    pub(super) async fn pass(self, mut request: Request, next: Next) -> Response {
        let mut answer = match self.check(&request) {
            Ok(path) => {
                let query = request.uri().query().map_or_else(String::new, |query| format!("?{query}"));
                match format!("{path}{query}").parse() {
                    Ok(uri) => {
                        *request.uri_mut() = uri;
                        // of an upload the body is counted where it is written
                        let upload = request.method() == Method::PUT;
                        match if upload { Ok(request) } else { Self::whole(request).await } {
                            Ok(request) => next.run(request).await,
                            Err(refused) => refused.into_response(),
                        }
                    }
                    Err(_) => Refused::new(StatusCode::NOT_FOUND, "not found").into_response(),
                }
            }
            Err(refused) => refused.into_response(),
        };
        for (name, value) in HEADERS {
            // a report has a policy of its own
            let header = answer.headers_mut().entry(name);
            header.or_insert(HeaderValue::from_static(value));
        }
        answer
    }
}

const HEADERS: [(&str, &str); 6] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cache-control", "no-store"),
];

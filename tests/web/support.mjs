// A server in a folder of its own, and what tests ask of it.
import { execFileSync, spawn } from 'node:child_process';
import { once } from 'node:events';
import fs from 'node:fs';
import net from 'node:net';
import os from 'node:os';
import path from 'node:path';
import readline from 'node:readline';

export const ROOT = path.resolve(import.meta.dirname, '../..');
export const PAGE = path.join(ROOT, 'src/serve/page');
export const BINARY = path.resolve(process.env.KFDESIGN ?? path.join(ROOT, 'target/release/kfdesign'));

/** The command line in a folder: what it printed, and its exit status. */
export function kfdesign(folder, ...words) {
  try {
    const options = { cwd: folder, encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'], maxBuffer: 1 << 28 };
    return { status: 0, stdout: execFileSync(BINARY, words, options) };
  } catch (error) {
    if (typeof error.status !== 'number') throw error;
    return { status: error.status, stdout: error.stdout, stderr: error.stderr };
  }
}

/** A temporary folder with the shipped data and, where minutes are given, a simulated log and its filter. */
export function folder(minutes = 0) {
  const place = fs.realpathSync(fs.mkdtempSync(path.join(os.tmpdir(), 'kfdesign-web-')));
  for (const name of ['params.json', 'airplanes', 'flights', 'sensors', 'wrong']) {
    fs.cpSync(path.join(ROOT, 'data', name), path.join(place, name), { recursive: true });
  }
  if (minutes > 0) {
    const done = [
      kfdesign(place, 'simulate', 'params.json', '-o', 'log.npy', '--duration', `${minutes}min`, '--seed', '7'),
      kfdesign(place, 'tune', 'params.json', '-o', 'filter.json'),
    ];
    for (const { status, stderr } of done) if (status !== 0) throw new Error(stderr);
  }
  return place;
}

/** Starts the server on any port. */
export async function serve(place, ...options) {
  const anyPort = options.includes('--port') ? [] : ['--port', '0'];
  const words = ['serve', place, '--no-open', ...anyPort, ...options];
  const child = spawn(BINARY, words, { stdio: ['ignore', 'pipe', 'pipe'] });
  let said = '';
  child.stderr.setEncoding('utf8').on('data', (text) => (said += text));
  const ended = once(child, 'exit').then(([status, signal]) => ({ status, signal, said }));
  const first = once(readline.createInterface({ input: child.stdout }), 'line').then(([line]) => line);
  const line = await Promise.race([first, ended.then(({ said }) => Promise.reject(new Error(said || 'ended')))]);
  const url = line.trim();
  const [, port, token] = /^http:\/\/127\.0\.0\.1:(\d+)\/([^/]+)\/$/.exec(url) ?? [];
  if (!token) throw new Error(`expected an address with a token: ${url}`);
  return {
    url,
    port: Number(port),
    token,
    folder: place,
    pid: child.pid,
    ended,
    /** What it has said on stderr so far. */
    said: () => said,
    signal: (name) => child.kill(name),
    async stop() {
      if (child.exitCode === null) child.kill('SIGKILL');
      await ended;
      fs.rmSync(place, { recursive: true, force: true });
    },
    // a kept connection may be closed by the server while a test blocks
    get: (route, headers = {}) => fetch(url + route, { headers: { Connection: 'close', ...headers } }),
    post: (route, body, headers = {}) =>
      fetch(url + route, {
        method: 'POST',
        headers: { Connection: 'close', 'Content-Type': 'application/json', ...headers },
        body: typeof body === 'string' ? body : JSON.stringify(body),
      }),
    put: (route, body) => fetch(url + route, { method: 'PUT', body }),
    /** Bytes as they are on a connection of their own; the whole answer. */
    raw: (text) => raw(Number(port), text),
    /** A request with these lines of headers in place of the usual ones. */
    ask(method, route, lines = [], body = '') {
      const named = (name) => lines.some((line) => line.toLowerCase().startsWith(`${name}:`));
      const own = named('host') ? [] : [`Host: 127.0.0.1:${port}`];
      if (body && !named('content-length') && !named('transfer-encoding')) {
        own.push(`Content-Length: ${Buffer.byteLength(body)}`);
      }
      const head = [`${method} ${route} HTTP/1.1`, ...own, ...lines, 'Connection: close', '', ''];
      return raw(Number(port), head.join('\r\n') + body);
    },
    /** A job, when it has ended. */
    async job(command, request, more = {}) {
      const answer = await this.post('api/jobs', { command, request, ...more });
      const job = await answer.json();
      if (answer.status !== 202) throw new Error(`${answer.status}: ${job.error}`);
      return this.finished(job.id);
    },
    async finished(id) {
      for (;;) {
        const answer = await this.get(`api/jobs/${id}`);
        const job = await answer.json();
        if (answer.status !== 200) throw new Error(job.error);
        if (['done', 'failed', 'stopped'].includes(job.state)) return job;
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
    },
  };
}

/** An answer as the connection gave it. */
function raw(port, text) {
  return new Promise((resolve) => {
    const chunks = [];
    const socket = net.connect(port, '127.0.0.1', () => socket.write(text));
    const done = () => {
      const all = Buffer.concat(chunks).toString('latin1');
      const [head, ...rest] = all.split('\r\n\r\n');
      const [status, ...lines] = head.split('\r\n');
      const headers = Object.fromEntries(
        lines.map((line) => [line.slice(0, line.indexOf(':')).toLowerCase(), line.slice(line.indexOf(':') + 1).trim()]),
      );
      resolve({ status: Number(status.split(' ')[1] ?? 0), headers, body: rest.join('\r\n\r\n') });
    };
    // one that has answered may still wait for a body that never comes
    socket.on('data', (chunk) => chunks.push(chunk) && setTimeout(() => socket.destroy(), 1000));
    // longer than the server waits for headers; no answer is status 0
    setTimeout(() => socket.destroy(), 15_000).unref();
    // a server that refuses may close before all was written
    socket.on('error', done).on('close', done);
  });
}

/** Names of all files below a folder, hidden ones too. */
export function files(place) {
  return fs.readdirSync(place, { recursive: true }).map(String).sort();
}

const BROWSERS = ['chromium', 'chromium-browser', 'google-chrome'];

/** Where a browser is; without one tests are skipped, but not in CI. */
export function browserPath() {
  const places = (process.env.PATH ?? '').split(path.delimiter);
  const all = BROWSERS.flatMap((name) => places.map((place) => path.join(place, name)));
  const found = process.env.CHROMIUM ?? all.find((file) => fs.existsSync(file));
  if (!found && process.env.CI === 'true') throw new Error('chromium not found: apt-get install chromium');
  if (!found) console.log('skipped: chromium not found');
  return found;
}

export async function launch(found) {
  const { chromium } = await import('playwright-core');
  const args = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking'];
  args.push('--disable-component-update', '--disable-sync');
  return chromium.launch({ executablePath: found, args });
}

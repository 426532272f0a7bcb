// Who may ask, and what they get: nobody but the page itself, and nothing but files of the folder.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import net from 'node:net';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';

import { files, folder, serve } from './support.mjs';

const SECRET = 'S3CRET-OF-ANOTHER-FOLDER';
let server;
let outside;

before(async () => {
  const place = folder();
  outside = fs.mkdtempSync(path.join(os.tmpdir(), 'kfdesign-outside-'));
  fs.writeFileSync(path.join(outside, 'secret.csv'), `time (s),gyro_x (deg/s)\n0,${SECRET}\n`);
  fs.writeFileSync(path.join(outside, 'secret.json'), JSON.stringify({ format: SECRET }));
  fs.symlinkSync(path.join(outside, 'secret.csv'), path.join(place, 'link.csv'));
  fs.symlinkSync(outside, path.join(place, 'linked'));
  fs.symlinkSync(path.join(outside, 'new.json'), path.join(place, 'dangling.json'));
  fs.writeFileSync(path.join(place, '.hidden.csv'), `time (s),gyro_x (deg/s)\n0,${SECRET}\n`);
  fs.mkdirSync(path.join(place, '.kfdesign'));
  fs.writeFileSync(path.join(place, '.kfdesign/draft.json'), SECRET);
  execFileSync('mkfifo', [path.join(place, 'fifo.csv')]);
  server = await serve(place);
});

after(async () => {
  await server.stop();
  fs.rmSync(outside, { recursive: true });
});

const info = { command: 'info', request: { log: 'params.json' } };

/** Whatever was refused changed nothing. */
async function unchanged(work) {
  const known = files(server.folder);
  const jobs = (await (await server.get('api/project')).json()).jobs.length;
  await work();
  assert.deepEqual(files(server.folder), known);
  assert.equal((await (await server.get('api/project')).json()).jobs.length, jobs);
}

test('it listens on loopback alone', () => {
  const port = server.port.toString(16).toUpperCase().padStart(4, '0');
  const listening = ['tcp', 'tcp6'].flatMap((family) =>
    fs
      .readFileSync(`/proc/net/${family}`, 'utf8')
      .split('\n')
      .slice(1)
      .map((line) => line.trim().split(/\s+/))
      .filter((cells) => cells[1]?.endsWith(`:${port}`) && cells[3] === '0A'),
  );
  const own = ['0100007F', '00000000000000000000000001000000'];
  assert.ok(listening.length >= 1);
  for (const [, address] of listening) assert.ok(own.includes(address.split(':')[0]), address);
});

test('the token has 192 bits, is new at every start, and stands in no answer and no log', async () => {
  const other = await serve(folder());
  await other.stop();
  assert.notEqual(other.token, server.token);
  const bits = { hex: 4, base32: 5, base64: 6 };
  const kind = /^[0-9a-f]+$/.test(server.token) ? 'hex' : /^[a-z2-7]+$/i.test(server.token) ? 'base32' : 'base64';
  assert.ok(server.token.length * bits[kind] >= 192, server.token.length);
  assert.ok(!server.said().includes(server.token));
  for (const route of ['', 'api/project', 'no/such']) {
    const answer = await server.get(route);
    assert.ok(!(await answer.text()).includes(server.token), route);
    assert.equal(answer.headers.get('referrer-policy'), 'no-referrer');
  }
});

test('without the token there is nothing, and no hint', async () => {
  const wrong = server.token.replace(/^./, (first) => (first === 'a' ? 'b' : 'a'));
  const routes = [
    '/',
    '/api/project',
    `/${wrong}/`,
    `/${wrong}/api/project`,
    `/${server.token.slice(0, -1)}/`,
    `/${server.token}`,
    `/x/${server.token}/`,
    `//${server.token}/`,
    '/favicon.ico',
    `/${server.token.toUpperCase()}x/`,
  ];
  const answers = await Promise.all(routes.map((route) => server.ask('GET', route)));
  for (const [i, answer] of answers.entries()) {
    assert.equal(answer.status, 404, routes[i]);
    assert.equal(answer.body, answers[0].body);
    assert.ok(!answer.body.includes(server.token));
  }
});

test('a foreign, missing or second Host is refused', async () => {
  const { port, token } = server;
  for (const host of [`127.0.0.1:${port}`, `localhost:${port}`, `[::1]:${port}`]) {
    assert.equal((await server.ask('GET', `/${token}/`, [`Host: ${host}`])).status, 200, host);
  }
  const foreign = [
    `evil.example:${port}`,
    'evil.example',
    '127.0.0.1',
    `127.0.0.1:${port + 1}`,
    `127.0.0.1.evil:${port}`,
    `0.0.0.0:${port}`,
    `127.1:${port}`,
    `user@127.0.0.1:${port}`,
    '',
  ];
  for (const host of foreign) {
    const answer = await server.ask('GET', `/${token}/`, [`Host: ${host}`]);
    assert.ok([400, 421].includes(answer.status), `${host}: ${answer.status}`);
  }
  const two = [`Host: 127.0.0.1:${port}`, 'Host: evil.example'];
  for (const lines of [two, [...two].reverse()]) {
    assert.ok([400, 421].includes((await server.ask('GET', `/${token}/`, lines)).status));
  }
  const none = await server.raw(`GET /${token}/ HTTP/1.1\r\nConnection: close\r\n\r\n`);
  assert.ok([400, 421].includes(none.status), none.status);
  for (const absolute of [`http://evil.example:${port}/${token}/`, `http://127.0.0.1:${port}/${token}/`]) {
    assert.ok([400, 421].includes((await server.ask('GET', absolute)).status), absolute);
  }
});

test('a foreign Origin, and none that is null, may not ask', async () => {
  const { port, token } = server;
  const asked = (origin) => server.ask('GET', `/${token}/api/project`, [`Origin: ${origin}`]);
  assert.equal((await asked(`http://127.0.0.1:${port}`)).status, 200);
  const foreign = [
    'null',
    'http://evil.example',
    `https://127.0.0.1:${port}`,
    `http://127.0.0.1:${port + 1}`,
    `http://127.0.0.1:${port}.evil.example`,
    'file://',
    '',
  ];
  for (const origin of foreign) assert.equal((await asked(origin)).status, 403, origin);
  await unchanged(async () => {
    const lines = ['Origin: null', 'Content-Type: application/json'];
    assert.equal((await server.ask('POST', `/${token}/api/jobs`, lines, JSON.stringify(info))).status, 403);
    const put = await server.ask('PUT', `/${token}/api/upload/a.csv`, ['Origin: http://evil.example'], 'x');
    assert.equal(put.status, 403);
  });
});

test('what another site asks for is refused', async () => {
  const asked = (site) => server.ask('GET', `/${server.token}/api/project`, [`Sec-Fetch-Site: ${site}`]);
  for (const site of ['same-origin', 'none']) assert.equal((await asked(site)).status, 200, site);
  for (const site of ['cross-site', 'same-site', 'Cross-Site']) assert.equal((await asked(site)).status, 403, site);
});

test('a POST is JSON and says so', async () => {
  await unchanged(async () => {
    for (const kind of [
      'text/plain',
      'application/x-www-form-urlencoded',
      'multipart/form-data; boundary=x',
      'text/plain; application/json',
      'application/jsonx',
    ]) {
      for (const route of ['api/jobs', 'api/curve', 'api/save', 'api/jobs/1/save']) {
        assert.equal((await server.post(route, info, { 'Content-Type': kind })).status, 415, `${route} ${kind}`);
      }
    }
    const none = await server.ask('POST', `/${server.token}/api/jobs`, [], JSON.stringify(info));
    assert.equal(none.status, 415);
  });
});

test('nobody may ask whether they may ask', async () => {
  for (const route of ['', 'api/project', 'api/jobs', 'api/upload/a.csv', 'no/such']) {
    const lines = ['Origin: http://evil.example', 'Access-Control-Request-Method: POST'];
    const foreign = await server.ask('OPTIONS', `/${server.token}/${route}`, lines);
    assert.ok([403, 405].includes(foreign.status), `${route}: ${foreign.status}`);
    assert.equal((await server.ask('OPTIONS', `/${server.token}/${route}`)).status, 405, route);
    assert.ok(!Object.keys(foreign.headers).some((name) => name.startsWith('access-control')));
  }
  for (const method of ['TRACE', 'CONNECT', 'PATCH', 'PROPFIND', 'DELETE', 'PUT']) {
    const { status } = await server.ask(method, `/${server.token}/api/project`);
    assert.ok(status >= 400 && status < 500, `${method}: ${status}`);
  }
});

test('every answer keeps the page closed', async () => {
  const policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; " +
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
  const routes = ['', 'app.js', 'app.css', 'uPlot.iife.min.js', 'api/project', 'api/jobs/999999', 'no/such'];
  for (const route of routes) {
    const { headers } = await server.get(route);
    assert.equal(headers.get('content-security-policy'), policy, route);
    assert.equal(headers.get('x-content-type-options'), 'nosniff', route);
    assert.equal(headers.get('cross-origin-opener-policy'), 'same-origin', route);
    assert.equal(headers.get('cross-origin-resource-policy'), 'same-origin', route);
    assert.equal(headers.get('cache-control'), 'no-store', route);
    assert.equal(headers.get('access-control-allow-origin'), null, route);
  }
  assert.match((await server.get('')).headers.get('content-type'), /^text\/html/);
  assert.match((await server.get('app.js')).headers.get('content-type'), /^text\/javascript/);
});

test('a report may not run scripts', async () => {
  const job = await server.job('tune', { params: 'params.json', runs: 10 });
  const page = await server.get(`api/jobs/${job.id}/page`);
  const policy = page.headers.get('content-security-policy');
  assert.match(policy, /default-src 'none'/);
  assert.match(policy, /sandbox/);
  assert.ok(!/script-src|unsafe-eval/.test(policy), policy);
});

/** Names that lead elsewhere. */
function elsewhere() {
  return [
    '../secret.csv',
    `${outside}/secret.csv`,
    'linked/secret.csv',
    'link.csv',
    './../x/secret.csv',
    'flights/../../secret.csv',
    '/etc/passwd',
    '/dev/zero',
    '/proc/self/environ',
    'fifo.csv',
    'flights',
    '.',
    '.hidden.csv',
    '.kfdesign/draft.json',
    'C:\\secret.csv',
    'C:secret.csv',
    'flights\\..\\secret.csv',
    'params.json\0.csv',
    '\0',
    '',
    '~/secret.csv',
    'file:///etc/passwd',
    '//etc/passwd',
  ];
}

test('no path leads out of the assets', async () => {
  const paths = [
    '../Cargo.toml',
    '..%2fparams.json',
    '%2e%2e/params.json',
    '%2e%2e%2f%2e%2e%2fetc/passwd',
    '//etc/passwd',
    '/etc/passwd',
    '..\\params.json',
    '..%5cparams.json',
    'app.js%00.html',
    '%00',
    'C:/x',
    'params.json',
    '.hidden.csv',
    'fifo.csv',
    './app.js/',
    'link.csv',
    'api/../app.js/..',
    'api/upload/../../x',
  ];
  for (const one of paths) {
    const answer = await server.ask('GET', `/${server.token}/${one}`);
    assert.ok([400, 403, 404, 405].includes(answer.status), `${one}: ${answer.status}`);
    assert.ok(!answer.body.includes(SECRET) && !answer.body.includes('root:'), one);
  }
});

test('no series of a file outside of the folder, of a link, a pipe or a hidden file', async () => {
  for (const name of elsewhere()) {
    const answer = await server.get(`api/series?log=${encodeURIComponent(name)}`);
    const body = await answer.text();
    assert.ok([403, 404].includes(answer.status), `${JSON.stringify(name)}: ${answer.status} ${body}`);
    assert.ok(!body.includes(SECRET) && !body.includes('root:'), name);
  }
});

test('no job reads outside of the folder', async () => {
  const known = files(server.folder);
  {
    for (const name of elsewhere().filter(Boolean)) {
      const requests = [
        ['info', { log: name }],
        ['tune', { params: name }],
        ['identify', { logs: [name] }],
        ['replay', { filter: name, log: name }],
        ['loop', { flight: name }],
        ['tune', { params: 'params.json', plant: { plant: name } }],
        ['tune', { params: 'params.json', plant: { accelerometer: `${name}:x` } }],
        ['simulate', { params: 'params.json', output: 'o.csv', true_rate: `file:${name}` }],
      ];
      for (const [command, request] of requests) {
        const answer = await server.post('api/jobs', { command, request });
        const body = await answer.text();
        const said = `${command} ${JSON.stringify(name)}: ${answer.status} ${body}`;
        // a name that is only strange is that of no file
        const strange = answer.status === 202 && (await server.finished(JSON.parse(body).id)).state === 'failed';
        assert.ok([400, 403].includes(answer.status) || strange, said);
        assert.ok(!body.includes(SECRET), name);
      }
    }
  }
  assert.deepEqual(files(server.folder), known);
});

test('no document that is sent names a file outside of the folder', async () => {
  const flight = JSON.parse(fs.readFileSync(path.join(server.folder, 'flights/aerosonde.json'), 'utf8'));
  for (const name of [
    `${outside}/secret.json`,
    '../secret.json',
    '/etc/passwd',
    'linked/secret.json',
    '.kfdesign/draft.json',
  ]) {
    for (const draft of [
      { ...flight, airplane: name },
      { ...flight, sensors: { ...flight.sensors, gyro: name } },
    ]) {
      const answer = await server.post('api/jobs', {
        command: 'loop',
        request: { flight: 'draft:f' },
        drafts: { f: draft },
      });
      let body = await answer.json();
      if (answer.status === 202) body = await server.finished(body.id);
      const said = JSON.stringify(body);
      assert.ok(answer.status === 403 || body.state === 'failed', `${name}: ${said.slice(0, 300)}`);
      assert.ok(!said.includes(SECRET) && !said.includes('root:'), said);
    }
  }
});

test('no job writes outside of the folder', async () => {
  await unchanged(async () => {
    for (const output of [
      `${outside}/new.csv`,
      '../new.csv',
      'linked/new.csv',
      'dangling.json',
      '.new.csv',
      'a\\b.csv',
      '/dev/shm/new.csv',
    ]) {
      const answer = await server.post('api/jobs', {
        command: 'simulate',
        request: { params: 'params.json', output, duration: '1s' },
      });
      assert.equal(answer.status, 403, output);
      const saved = await server.post('api/save', { name: output, text: 'x' });
      assert.equal(saved.status, 403, output);
    }
    assert.deepEqual(fs.readdirSync(outside).sort(), ['secret.csv', 'secret.json']);
  });
});

test('hidden files, links and pipes are not listed', async () => {
  const { files } = await (await server.get('api/project')).json();
  const names = files.map((file) => file.name);
  assert.ok(names.includes('params.json'));
  for (const name of names) assert.ok(!/^\.|\/\.|link|fifo|dangling/.test(name), name);
});

test('a read-only server writes nothing', async () => {
  const own = await serve(folder(), '--read-only');
  try {
    const known = files(own.folder);
    const job = await own.job('tune', { params: 'params.json', runs: 10 });
    assert.equal(job.state, 'done');
    assert.equal((await own.post(`api/jobs/${job.id}/save`, { what: 'file', name: 'f.json' })).status, 403);
    assert.equal((await own.post('api/save', { name: 'a.json', document: {} })).status, 403);
    assert.equal((await own.put('api/upload/a.csv', 'x')).status, 403);
    const output = { params: 'params.json', output: 'o.npy', duration: '1s' };
    assert.equal((await own.post('api/jobs', { command: 'simulate', request: output })).status, 403);
    assert.deepEqual(files(own.folder), known);
  } finally {
    await own.stop();
  }
});

test('an address in the network is refused', async () => {
  const addresses = Object.values(os.networkInterfaces())
    .flat()
    .filter((one) => !one.internal && one.family === 'IPv4');
  for (const { address } of addresses) {
    await assert.rejects(
      new Promise((resolve, reject) => {
        const socket = net.connect(server.port, address, resolve).on('error', reject);
        socket.on('connect', () => socket.destroy());
      }),
      address,
    );
  }
});

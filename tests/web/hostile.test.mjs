// Too much of everything: the server refuses, stays small, and goes on.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import net from 'node:net';
import path from 'node:path';
import zlib from 'node:zlib';
import { after, afterEach, before, test as plain } from 'node:test';

import { files, folder, kfdesign, serve } from './support.mjs';

/** One that hangs fails, and the next begins. */
const test = (name, work) => plain(name, { timeout: 45_000 }, work);
/** Bytes of an upload. */
const LIMIT = 1 << 20;
/** Of the server, MB: one log and a job, far from what any of these floods would take if it were held. */
const MOST_MEMORY = 400;
const MOST_THREADS = 64;
let server;
/** Longer than any test. */
const long = { command: 'montecarlo', request: { filter: 'filter.json', runs: '1000000' } };

before(async () => {
  server = await serve(folder(1), '--upload-limit', String(LIMIT));
});
after(() => server.stop());

function facts() {
  const status = fs.readFileSync(`/proc/${server.pid}/status`, 'utf8');
  const number = (name) => Number(new RegExp(`^${name}:\\s+(\\d+)`, 'm').exec(status)[1]);
  return { threads: number('Threads'), memory: number('VmRSS') / 1024 };
}

/** It answers, and has not grown. */
async function isWell() {
  const answer = await server.get('api/project', { Connection: 'close' });
  assert.equal(answer.status, 200);
  await answer.text();
  const { threads, memory } = facts();
  assert.ok(threads <= MOST_THREADS, `${threads} threads`);
  assert.ok(memory <= MOST_MEMORY, `${memory} MB`);
}
afterEach(isWell);

async function stopAll() {
  const { jobs } = await (await server.get('api/project')).json();
  const busy = jobs.filter((job) => ['waiting', 'running'].includes(job.state));
  await Promise.all(busy.map((job) => fetch(`${server.url}api/jobs/${job.id}`, { method: 'DELETE' })));
  await Promise.all(busy.map((job) => server.finished(job.id)));
}

test('a request is no larger than 1 MiB', async () => {
  const large = JSON.stringify({ command: 'info', request: { log: 'x'.repeat(1 << 20) } });
  for (const route of ['api/jobs', 'api/curve', 'api/save', 'api/preview']) {
    assert.equal((await server.post(route, large)).status, 413, route);
  }
  const lines = ['Content-Type: application/json', 'Content-Length: 2147483648'];
  const said = await server.ask('POST', `/${server.token}/api/jobs`, lines, '{');
  assert.equal(said.status, 413);
});

test('a request without a length is counted as it comes', async () => {
  const piece = 'x'.repeat(64 << 10);
  const chunk = `${piece.length.toString(16)}\r\n${piece}\r\n`;
  const lines = ['Content-Type: application/json', 'Transfer-Encoding: chunked'];
  const start = `4\r\n{"a"\r\n`;
  const answer = await server.ask('POST', `/${server.token}/api/jobs`, lines, start + chunk.repeat(64));
  // the server may close while the client still writes
  assert.ok([413, 0].includes(answer.status), answer.status);
  const known = files(server.folder);
  const upload = await server.ask(
    'PUT',
    `/${server.token}/api/upload/much.csv`,
    lines.slice(1),
    start + chunk.repeat(64),
  );
  assert.ok([413, 0].includes(upload.status), upload.status);
  assert.deepEqual(files(server.folder), known);
});

test('an upload has a limit, plain names, and replaces nothing', async () => {
  const known = files(server.folder);
  assert.equal((await server.put('api/upload/large.csv', 'x'.repeat(LIMIT + 1))).status, 413);
  const before = fs.readFileSync(path.join(server.folder, 'params.json'), 'utf8');
  assert.equal((await server.put('api/upload/params.json', '{}')).status, 409);
  assert.equal(fs.readFileSync(path.join(server.folder, 'params.json'), 'utf8'), before);
  const names = [
    '.hidden.csv',
    '..',
    'a b.csv',
    'a%2fb.csv',
    '..%2fa.csv',
    '%2e%2e%2fa.csv',
    'a%00.csv',
    'a%5cb.csv',
    '%3Cimg%20src=x%3E.csv',
    'ü.csv',
    `${'a'.repeat(300)}.csv`,
    'a:b.csv',
    'flights',
    '',
  ];
  for (const name of names) {
    const { status } = await server.ask('PUT', `/${server.token}/api/upload/${name}`, [], 'x');
    assert.ok(status >= 400 && status < 500, `${name}: ${status}`);
  }
  assert.deepEqual(files(server.folder), known);
  assert.equal((await server.put('api/upload/whole.csv', 'time (s)\n')).status, 201);
  assert.equal(fs.readFileSync(path.join(server.folder, 'whole.csv'), 'utf8'), 'time (s)\n');
  fs.rmSync(path.join(server.folder, 'whole.csv'));
});

test('an upload that breaks off leaves nothing', async () => {
  const known = files(server.folder);
  await new Promise((resolve) => {
    const host = `Host: 127.0.0.1:${server.port}`;
    const head = `PUT /${server.token}/api/upload/half.csv HTTP/1.1\r\n${host}\r\nContent-Length: 1000\r\n\r\n`;
    const socket = net.connect(server.port, '127.0.0.1', () =>
      socket.write(head + 'half', () =>
        setTimeout(() => {
          socket.destroy();
          resolve();
        }, 100),
      ),
    );
  });
  for (let i = 0; i < 100 && files(server.folder).length > known.length; i++) {
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  assert.deepEqual(files(server.folder), known);
});

test('a bomb of brackets is refused', async () => {
  const deep = (open, close) => open.repeat(200_000) + close.repeat(200_000);
  for (const bomb of [
    deep('[', ']'),
    deep('{"a":', '}').slice(0, 900_000),
    `{"command":"info","request":${deep('[', ']')}}`,
  ]) {
    for (const route of ['api/jobs', 'api/curve', 'api/save', 'api/preview']) {
      const { status } = await server.post(route, bomb);
      assert.ok(status >= 400 && status < 500, `${route}: ${status}`);
    }
  }
});

test('what is no request is refused in one line', async () => {
  const bodies = [
    '',
    '{',
    'null',
    '[]',
    '"x"',
    '{}',
    '{"command":"rm","request":{}}',
    '{"command":"info"}',
    '{"command":"info","request":{"log":1}}',
    '{"command":"info","request":{"log":"params.json","shell":"rm"}}',
    '{"command":"serve","request":{}}',
    '{"command":"../x","request":{}}',
    '\u0000',
    '{"command":"info","request":null}',
  ];
  for (const body of bodies) {
    const answer = await server.post('api/jobs', body);
    let said = await answer.json();
    if (answer.status === 202) said = await server.finished(said.id);
    assert.ok(typeof said.error === 'string' && !said.error.includes('\n'), `${body}: ${JSON.stringify(said)}`);
  }
});

test('bytes that are no HTTP are closed', async () => {
  const all = [
    '\x16\x03\x01\x02\x00\x01',
    'GET\r\n\r\n',
    'hello\r\n\r\n',
    `GET /${server.token}/ HTTP/9.9\r\n\r\n`,
    `GET /${'x'.repeat(70_000)} HTTP/1.1\r\n\r\n`,
  ];
  for (const bytes of all) {
    const { status } = await server.raw(bytes);
    assert.ok(status === 0 || status >= 400, `${bytes.slice(0, 20)}: ${status}`);
  }
  // two lengths, or length and chunks, let one hide a request behind another
  const smuggled = [
    ['Content-Length: 2', 'Content-Length: 3'],
    ['Content-Length: 2', 'Transfer-Encoding: chunked', 'Transfer-Encoding: identity'],
  ];
  for (const lines of smuggled) {
    const { status } = await server.ask(
      'POST',
      `/${server.token}/api/jobs`,
      ['Content-Type: application/json', ...lines],
      '{}',
    );
    assert.ok(status === 0 || status >= 400, `${lines}: ${status}`);
  }
});

test('a header of 32 MiB is cut off', async () => {
  const { status } = await server.ask('GET', `/${server.token}/`, [`X: ${'x'.repeat(32 << 20)}`]);
  assert.ok([0, 431].includes(status), status);
});

test('a flood of jobs is refused when 16 wait, and all can be stopped', async () => {
  const answers = await Promise.all(Array.from({ length: 100 }, () => server.post('api/jobs', long)));
  const statuses = answers.map((answer) => answer.status);
  const taken = statuses.filter((status) => status === 202).length;
  assert.ok(taken >= 16 && taken <= 18, taken);
  assert.equal(statuses.filter((status) => status === 429).length, 100 - taken);
  await stopAll();
  assert.equal((await server.job('info', { log: 'log.npy' })).state, 'done');
});

test('a job that ran can be forgotten, its number is gone for good', async () => {
  for (const id of ['999999', '-1', '0', 'x', '1e9', '18446744073709551616']) {
    const { status } = await server.get(`api/jobs/${id}`);
    assert.ok([400, 404].includes(status), `${id}: ${status}`);
  }
});

test('a hostile log fails its job, not the server', async () => {
  const noise = Buffer.from(Array.from({ length: 5000 }, (_, i) => (i * 7919 + (i >> 3) * 104729) & 255));
  const bomb = zlib.gzipSync(Buffer.alloc(256 << 20), { level: 9 });
  const hostile = {
    'empty.csv': '',
    'header.csv': 'time (s),gyro_x (deg/s)\n',
    'binary.csv': noise,
    'zeros.npy': Buffer.alloc(4096),
    'npy.npy': Buffer.concat([Buffer.from('\x93NUMPY\x01\x00\xff\xff', 'latin1'), noise]),
    'parquet.parquet': noise,
    'mat.mat': noise,
    'bag.bag': Buffer.concat([Buffer.from('#ROSBAG V2.0\n'), noise]),
    'ulog.ulg': Buffer.concat([Buffer.from('ULog\x01\x12\x35\x01', 'latin1'), noise]),
    'h5.h5': Buffer.concat([Buffer.from('\x89HDF\r\n\x1a\n', 'latin1'), noise]),
    'mcap.mcap': Buffer.concat([Buffer.from('\x89MCAP0\r\n', 'latin1'), noise]),
    'long.csv': `time (s),gyro_x (deg/s)\n${'1'.repeat(500_000)}\n`,
    'nan.csv': `time (s),gyro_x (deg/s)\n${'nan,nan\n'.repeat(1000)}`,
    'huge.csv': `time (s),gyro_x (deg/s)\n0,1e308\n0.01,-1e308\n${'0.02,1e308\n'.repeat(500)}`,
    'bomb.csv.gz': bomb,
    'db.db3': Buffer.concat([Buffer.from('SQLite format 3\0'), noise]),
    'params2.json': '{"format":"kfdesign-params/99"}',
  };
  for (const [name, bytes] of Object.entries(hostile)) {
    assert.equal((await server.put(`api/upload/${name}`, bytes)).status, 201, name);
    const jobs = [
      ['info', { log: name }],
      ['identify', { logs: [name] }],
      ['replay', { filter: 'filter.json', log: name }],
    ];
    for (const [command, request] of jobs) {
      const job = await server.job(command, request);
      // info may have something to say of a damaged log
      const states = command === 'info' ? ['failed', 'done'] : ['failed'];
      assert.ok(states.includes(job.state), `${command} ${name}: ${job.state}`);
      if (job.state === 'failed') assert.ok(job.error && !/defect|\n/.test(job.error), `${name}: ${job.error}`);
    }
    const answer = await server.get(`api/series?log=${name}&axis=0`);
    assert.ok(answer.status < 500, `${name}: ${answer.status} ${await answer.text()}`);
    fs.rmSync(path.join(server.folder, name));
  }
});

test('a document of a newer format is refused with its name', async () => {
  const job = await server.job(
    'tune',
    { params: 'draft:p', runs: 10 },
    { drafts: { p: { format: 'kfdesign-params/99' } } },
  );
  assert.equal(job.state, 'failed');
  assert.match(job.error, /draft:p/);
  assert.match(job.error, /params\/99/);
});

test('a file that vanishes fails its job', async () => {
  const blocker = await (await server.post('api/jobs', long)).json();
  fs.copyFileSync(path.join(server.folder, 'log.npy'), path.join(server.folder, 'gone.npy'));
  const { id } = await (await server.post('api/jobs', { command: 'info', request: { log: 'gone.npy' } })).json();
  fs.rmSync(path.join(server.folder, 'gone.npy'));
  await fetch(`${server.url}api/jobs/${blocker.id}`, { method: 'DELETE' });
  const job = await server.finished(id);
  assert.equal(job.state, 'failed');
  assert.match(job.error, /gone\.npy/);
});

test('a stopped job is stopped, and its result is not there', async () => {
  const { id } = await (await server.post('api/jobs', long)).json();
  assert.equal((await server.get(`api/jobs/${id}/document`)).status, 409);
  await fetch(`${server.url}api/jobs/${id}`, { method: 'DELETE' });
  assert.equal((await server.finished(id)).state, 'stopped');
  assert.equal((await server.get(`api/jobs/${id}/document`)).status, 409);
});

test('of two previews the newer wins', async () => {
  const slow = {
    command: 'tune',
    request: {
      params: 'params.json',
      plant: { plant: 'angle', aid: ['heading: 2 deg @ 1 Hz'] },
      insight: true,
      runs: 1000,
    },
  };
  const fast = { command: 'loop', request: { flight: 'flights/aerosonde-loop.json' } };
  const first = server.post('api/preview', slow);
  await new Promise((resolve) => setTimeout(resolve, 200));
  const second = await server.post('api/preview', fast);
  assert.equal(second.status, 200);
  assert.equal((await second.json()).format, 'kfdesign-loop/1');
  assert.equal((await first).status, 409);
});

/** So many connections that send this and then wait. */
async function idle(count, text) {
  const sockets = await Promise.all(
    Array.from(
      { length: count },
      () =>
        new Promise((resolve) => {
          const socket = net.connect(server.port, '127.0.0.1', () => {
            if (text) socket.write(text);
            resolve(socket);
          });
          socket.on('error', () => resolve(socket));
        }),
    ),
  );
  return () => sockets.forEach((socket) => socket.destroy());
}

test('200 half-open requests and 500 idle connections cost nothing', async () => {
  const host = `Host: 127.0.0.1:${server.port}`;
  const closers = [await idle(200, `GET /${server.token}/ HTTP/1.1\r\n${host}\r\n`), await idle(500)];
  assert.ok(facts().threads <= MOST_THREADS);
  assert.ok(facts().memory <= MOST_MEMORY);
  closers.forEach((close) => close());
  // those that waited in the queue of the system are gone too: whoever comes now is answered
  await isWell();
});

test('a request that is not ended is closed by the server', async () => {
  const socket = net.connect(server.port, '127.0.0.1', () => socket.write(`GET /${server.token}/ HTTP/1.1\r\n`));
  socket.resume();
  await new Promise((resolve) => socket.on('close', resolve));
});

test('a reader that never reads its events holds nobody up', async () => {
  const { id } = await (await server.post('api/jobs', long)).json();
  const head = `GET /${server.token}/api/jobs/${id}/events HTTP/1.1\r\nHost: 127.0.0.1:${server.port}\r\n\r\n`;
  const slow = await Promise.all(
    Array.from(
      { length: 10 },
      () =>
        new Promise((resolve) => {
          const socket = net.connect({ port: server.port, host: '127.0.0.1', highWaterMark: 1 }, () => {
            socket.pause();
            socket.write(head, () => resolve(socket));
          });
        }),
    ),
  );
  const seen = await server.get(`api/jobs/${id}/events`);
  const reader = seen.body.getReader();
  let text = '';
  while (!/event: ?running/.test(text)) text += Buffer.from((await reader.read()).value).toString();
  assert.match(text, /data: ?\{/);
  await isWell();
  await stopAll();
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    text += Buffer.from(value).toString();
  }
  assert.match(text, /event: ?stopped/);
  slow.forEach((socket) => socket.destroy());
});

test('Ctrl-C during a job: exit 130, and no unfinished file', async () => {
  for (const name of ['SIGINT', 'SIGTERM']) {
    const own = await serve(folder(1));
    const known = files(own.folder);
    const request = { params: 'params.json', output: 'out.csv', duration: '1000h' };
    const { id } = await (await own.post('api/jobs', { command: 'simulate', request })).json();
    const draft = JSON.parse(fs.readFileSync(path.join(own.folder, 'params.json'), 'utf8'));
    await own.post('api/jobs', { command: 'tune', request: { params: 'draft:p' }, drafts: { p: draft } });
    while ((await (await own.get(`api/jobs/${id}`)).json()).state === 'waiting');
    await new Promise((resolve) => setTimeout(resolve, 300));
    own.signal(name);
    const { status, signal } = await own.ended;
    const expected = name === 'SIGINT' ? 130 : 143;
    assert.ok(status === expected || signal === name, `${name}: ${status} ${signal}`);
    assert.deepEqual(files(own.folder), known);
    await own.stop();
  }
});

test('a folder that cannot be served, and a port that is taken', async () => {
  for (const [place, said] of [
    ['no/such', /no such folder/],
    ['params.json', /is a file/],
  ]) {
    const { status, stderr } = kfdesign(server.folder, 'serve', place, '--no-open', '--port', '0');
    assert.equal(status, 2);
    assert.match(stderr, said);
    assert.equal(stderr.trim().split('\n').length, 1);
  }
  const next = await serve(folder(), '--port', String(server.port));
  assert.notEqual(next.port, server.port);
  await next.stop();
});

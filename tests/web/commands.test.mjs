// Every command: its document is byte for byte what the command line of its `shell` prints with --json in the same
// folder.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';

import { BINARY, folder, kfdesign, serve } from './support.mjs';

let server;
let programs;

before(async () => {
  const place = folder(2);
  const shards = [
    ['0..10', 'a.json'],
    ['10..20', 'b.json'],
  ];
  for (const [runs, name] of shards)
    kfdesign(place, 'montecarlo', 'filter.json', '--runs', runs, '--duration', '60s', '-o', name);
  kfdesign(place, 'export', 'params.json', '--to', 'kalibr', '-o', 'imu.yaml');
  programs = fs.mkdtempSync(path.join(os.tmpdir(), 'kfdesign-bin-'));
  fs.symlinkSync(BINARY, path.join(programs, 'kfdesign'));
  server = await serve(place);
});
after(async () => {
  await server.stop();
  fs.rmSync(programs, { recursive: true });
});

/** As a person would paste it. */
function paste(line) {
  const env = { ...process.env, PATH: `${programs}:${process.env.PATH}` };
  return spawnSync('sh', ['-c', line], { cwd: server.folder, env, encoding: 'utf8', maxBuffer: 1 << 28 });
}

const loop = 'flights/aerosonde-loop.json';
const asked = [
  ['info', { log: 'log.npy' }],
  ['allan', { log: 'log.npy' }],
  [
    'allan',
    { log: 'log.npy', deviation: 'mdev', taus: 'decade', reading: { columns: ['gyro_x'], start: '10', end: '1min' } },
  ],
  ['identify', { logs: ['log.npy'] }],
  ['identify', { logs: ['log.npy'], method: 'graphical', hold: [], reading: { columns: ['gyro_y'] } }],
  ['identify', { logs: ['log.npy'], model: 'white+gm', hold: ['gauss_markov.correlation_time=200s'] }],
  ['plan', { params: 'params.json', parameter: 'gauss_markov.correlation_time', precision: '10%' }],
  ['compare', { params: 'params.json', log: 'log.npy', parameters: true }],
  ['inflate', { params: 'params.json', log: 'log.npy', from: 2 }],
  ['tune', { params: 'params.json', runs: 20 }],
  [
    'tune',
    { params: 'params.json', plant: { plant: 'angle', aid: ['heading: 2 deg @ 1 Hz'] }, insight: true, runs: 20 },
  ],
  ['rank', { files: ['filter.json', 'params.json', 'log.npy'], held_out: 1 / 3, flicker_horizon: 10000 }],
  ['replay', { filter: 'filter.json', log: 'log.npy', alpha: 0.02, form: 'square-root' }],
  ['montecarlo', { filter: 'filter.json', runs: '20', duration: '60s' }],
  ['merge', { shards: ['a.json', 'b.json'] }],
  ['import', { file: 'imu.yaml' }],
  ['datasheet', { rate: 100, angle_random_walk: '0.13 deg/sqrt(h)', bias_instability: '2.3 deg/h' }],
  ['airplane', { airplane: 'airplanes/aerosonde.json' }],
  ['trim', { file: 'airplanes/aerosonde.json', speed: '25 m/s', altitude: '100 m' }],
  ['fly', { flight: 'flights/aerosonde.json', duration: '2s' }],
  ['loop', { flight: loop }],
  ['loop', { flight: loop, sweep: 'noise' }],
];

for (const [command, request] of asked) {
  test(`${command} ${JSON.stringify(request)}`, async () => {
    const job = await server.job(command, request);
    assert.equal(job.state, 'done', job.error);
    const document = await (await server.get(`api/jobs/${job.id}/document`)).text();
    assert.ok(job.shell.startsWith('kfdesign '), job.shell);
    const printed = paste(`${job.shell} --json`);
    assert.ok([0, 1].includes(printed.status), printed.stderr);
    assert.equal(document, printed.stdout);
  });
}

test('simulate writes the same log', async () => {
  const request = { params: 'params.json', duration: '10s', seed: 2 };
  const job = await server.job('simulate', { ...request, output: 'page.npy' });
  assert.equal(job.state, 'done', job.error);
  kfdesign(server.folder, 'simulate', 'params.json', '--duration', '10s', '--seed', '2', '-o', 'line.npy');
  const [page, line] = ['page.npy', 'line.npy'].map((name) => fs.readFileSync(path.join(server.folder, name)));
  assert.ok(page.equals(line));
  assert.match(job.shell, /-o page\.npy|--output page\.npy/);
});

const consumers = [
  'kalibr',
  'openvins',
  'vins',
  'orbslam3',
  'gtsam',
  'px4',
  'ardupilot',
  'matlab',
  'gnss-ins-sim',
  'navego',
  'gazebo',
];
for (const to of consumers) {
  test(`export to ${to} is what the command prints`, async () => {
    const job = await server.job('export', { params: 'params.json', to });
    assert.equal(job.state, 'done', job.error);
    const all = await (await server.get(`api/jobs/${job.id}/files`)).json();
    assert.equal(all.map(([, text]) => text).join(''), paste(job.shell).stdout);
  });
}

for (const [to, name] of [
  ['c', 'drift.c'],
  ['rust', 'drift.rs'],
]) {
  test(`export to ${to} is what the command writes`, async () => {
    const job = await server.job('export', { params: 'filter.json', to, output: name });
    assert.equal(job.state, 'done', job.error);
    const all = await (await server.get(`api/jobs/${job.id}/files`)).json();
    const written = paste(job.shell);
    assert.equal(written.status, 0, written.stderr);
    for (const [file, text] of all) assert.equal(text, fs.readFileSync(path.join(server.folder, file), 'utf8'), file);
    assert.equal(all.length, to === 'c' ? 3 : 1);
  });
}

test('what is saved is what the command writes, and no save replaces unasked', async () => {
  const job = await server.job('tune', { params: 'params.json', runs: 20 });
  const save = (body) => server.post(`api/jobs/${job.id}/save`, body);
  assert.equal((await save({ what: 'file', name: 'page.json' })).status, 200);
  kfdesign(server.folder, 'tune', 'params.json', '--runs', '20', '-o', 'line.json');
  const text = (name) => fs.readFileSync(path.join(server.folder, name), 'utf8');
  assert.equal(text('page.json'), text('line.json'));
  fs.writeFileSync(path.join(server.folder, 'page.json'), 'own');
  assert.equal((await save({ what: 'file', name: 'page.json' })).status, 409);
  assert.equal(text('page.json'), 'own');
  assert.equal((await save({ what: 'file', name: 'page.json', replace: true })).status, 200);
  assert.equal(text('page.json'), text('line.json'));
});

test('report, test report and figures are what the command writes', async () => {
  const gate = await server.job('montecarlo', { filter: 'filter.json', runs: '20', duration: '60s' });
  const looped = await server.job('loop', { flight: loop });
  const parts = [
    [gate, 'page', '--report r.html', 'r.html'],
    [gate, 'junit', '--junit r.xml', 'r.xml'],
    [looped, 'page', '--report l.html', 'l.html'],
    [looped, 'figures', '--plot l.svg', 'l.svg'],
  ];
  for (const [job, what, flag, name] of parts) {
    assert.ok(job.has.includes(what), `${job.command}: ${job.has}`);
    const text = await (await server.get(`api/jobs/${job.id}/${what}`)).text();
    paste(`${job.shell} ${flag}`);
    assert.equal(text, fs.readFileSync(path.join(server.folder, name), 'utf8'), `${job.command} ${what}`);
  }
});

test('every command of the command line is asked for', () => {
  const help = kfdesign(server.folder, '--help').stdout;
  const all = [.../^Commands:\n([^]*?)\n\n/m.exec(help)[1].matchAll(/^ {2}(\w+)/gm)].map(([, name]) => name);
  const without = ['schema', 'completions', 'man', 'help', 'serve', 'simulate', 'export'];
  const known = new Set(asked.map(([command]) => command));
  assert.deepEqual(
    all.filter((name) => !known.has(name) && !without.includes(name)),
    [],
  );
});

// A page of another origin in the same browser, which knows the address and even the token.
import assert from 'node:assert/strict';
import http from 'node:http';
import { after, before, test } from 'node:test';

import { browserPath, files, folder, launch, serve } from './support.mjs';

const found = browserPath();
let server;
let browser;
let foreign;
let origin;

before(async () => {
  if (!found) return;
  server = await serve(folder());
  browser = await launch(found);
  foreign = http.createServer((request, answer) => {
    answer.setHeader('Content-Type', 'text/html');
    answer.end('<!doctype html><title>foreign</title><body></body>');
  });
  await new Promise((resolve) => foreign.listen(0, '127.0.0.1', resolve));
  origin = `http://localhost:${foreign.address().port}/`;
});
after(async () => {
  foreign?.close();
  await browser?.close();
  await server?.stop();
});

async function open() {
  const page = await browser.newPage();
  await page.goto(origin);
  return page;
}

test('it cannot fetch', { skip: !found }, async () => {
  const known = files(server.folder);
  const page = await open();
  const seen = await page.evaluate(async (url) => {
    const body = JSON.stringify({ command: 'info', request: { log: 'params.json' } });
    const json = { 'Content-Type': 'application/json' };
    const ways = [
      ['', {}],
      ['api/project', {}],
      ['api/project', { mode: 'no-cors' }],
      ['api/project', { credentials: 'include' }],
      ['api/jobs', { method: 'POST', body, headers: json }],
      ['api/jobs', { method: 'POST', body, mode: 'no-cors' }],
      ['api/jobs', { method: 'POST', body: new Blob([body], { type: 'text/plain' }), mode: 'no-cors' }],
      ['api/upload/foreign.csv', { method: 'PUT', body: 'x' }],
      ['api/jobs/1', { method: 'DELETE' }],
    ];
    const one = ([route, options]) =>
      fetch(url + route, options).then(
        (answer) => answer.text(),
        () => '',
      );
    return Promise.all(ways.map(one));
  }, server.url);
  assert.deepEqual(
    seen,
    seen.map(() => ''),
  );
  assert.equal((await (await server.get('api/project')).json()).jobs.length, 0);
  assert.deepEqual(files(server.folder), known);
  await page.close();
});

test('its form changes nothing', { skip: !found }, async () => {
  for (const kind of ['text/plain', 'application/x-www-form-urlencoded', 'multipart/form-data']) {
    const page = await open();
    const answer = page.waitForResponse((response) => response.url().startsWith(server.url));
    await page.evaluate(
      ([action, kind]) => {
        const form = Object.assign(document.createElement('form'), { method: 'POST', action, enctype: kind });
        const input = document.createElement('input');
        input.name = '{"command":"info","request":{"log":"params.json"},"x":"';
        input.value = '"}';
        form.append(input);
        document.body.append(form);
        form.submit();
      },
      [`${server.url}api/jobs`, kind],
    );
    assert.equal((await answer).status(), 403, kind);
    await page.close();
  }
  assert.equal((await (await server.get('api/project')).json()).jobs.length, 0);
});

test('it can neither frame nor open the workbench to look into it', { skip: !found }, async () => {
  const page = await open();
  const answer = page.waitForResponse((response) => response.url().startsWith(server.url));
  await page.evaluate((url) => {
    const frame = document.createElement('iframe');
    frame.src = url;
    document.body.append(frame);
  }, server.url);
  assert.equal((await answer).status(), 403);
  const looked = await page.evaluate(() => {
    try {
      return document.querySelector('iframe').contentDocument?.body.textContent ?? '';
    } catch {
      return '';
    }
  });
  assert.equal(looked, '');
  await page.close();
});

test('it can load nothing as script, style or picture', { skip: !found }, async () => {
  const page = await open();
  const loaded = await page.evaluate(
    (url) =>
      Promise.all(
        [
          ['script', 'src', 'app.js'],
          ['script', 'src', 'api/project'],
          ['img', 'src', 'api/project'],
          ['link', 'href', 'app.css'],
          ['script', 'src', 'uPlot.iife.min.js'],
        ].map(
          ([tag, key, route]) =>
            new Promise((resolve) => {
              const node = document.createElement(tag);
              if (tag === 'link') node.rel = 'stylesheet';
              node[key] = url + route;
              node.onload = () => resolve(route);
              node.onerror = () => resolve('');
              document.body.append(node);
            }),
        ),
      ),
    server.url,
  );
  assert.deepEqual(
    loaded,
    loaded.map(() => ''),
  );
  assert.equal(await page.evaluate(() => typeof globalThis.uPlot), 'undefined');
  await page.close();
});

test('it can open neither a WebSocket nor an event stream, and send no beacon', { skip: !found }, async () => {
  const page = await open();
  const opened = await page.evaluate((url) => {
    const way = (thing) =>
      new Promise((resolve) => {
        thing.onopen = () => resolve(true);
        thing.onerror = () => resolve(false);
      });
    navigator.sendBeacon(`${url}api/jobs`, '{"command":"info","request":{"log":"params.json"}}');
    return Promise.all([
      way(new WebSocket(url.replace('http', 'ws'))),
      way(new EventSource(`${url}api/jobs/1/events`)),
    ]);
  }, server.url);
  assert.deepEqual(opened, [false, false]);
  assert.equal((await (await server.get('api/project')).json()).jobs.length, 0);
  await page.close();
});

test('a link on it is not followed', { skip: !found }, async () => {
  const page = await open();
  const answer = page.waitForResponse((response) => response.url().startsWith(server.url));
  await page.evaluate((url) => {
    const link = Object.assign(document.createElement('a'), { href: url, textContent: 'open' });
    document.body.append(link);
    link.click();
  }, server.url);
  assert.equal((await answer).status(), 403);
  await page.close();
});

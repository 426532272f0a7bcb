// What the page is made of.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import crypto from 'node:crypto';
import fs from 'node:fs';
import path from 'node:path';
import { test } from 'node:test';

import { PAGE } from './support.mjs';

const all = fs.readdirSync(PAGE);
const own = all.filter((name) => !name.startsWith('uPlot'));
const text = (name) => fs.readFileSync(path.join(PAGE, name), 'utf8');

test('no text becomes HTML or code', () => {
  const ways =
    /innerHTML|outerHTML|insertAdjacentHTML|\beval\b|new Function|document\.write|DOMParser|setHTML|srcdoc|javascript:/;
  const lines = own
    .filter((name) => /\.(js|html)$/.test(name))
    .flatMap((name) =>
      text(name)
        .split('\n')
        .map((line, i) => `${name}:${i + 1}: ${line.trim()}`),
    );
  assert.ok(lines.length > 100);
  assert.deepEqual(
    lines.filter((line) => ways.test(line)),
    [],
  );
});

test('no script, style or handler stands in the HTML, and nothing comes from elsewhere', () => {
  const html = text('index.html');
  assert.ok(!/\sstyle=|\son\w+=|<style/i.test(html));
  for (const [tag] of html.matchAll(/<script[^>]*>/g)) assert.match(tag, /\ssrc="[\w.]+"/);
  for (const name of own) {
    const outside = text(name).match(/(?:https?:)?\/\/[a-z0-9-]+\.[a-z]{2,}[^\s"']*/gi) ?? [];
    assert.deepEqual(
      outside.filter((url) => !url.includes('www.w3.org')),
      [],
      name,
    );
  }
});

// comments and types are in it, and it goes over the loopback alone; packed it is a third of that
test('the page has at most 256 kB', () => {
  const bytes = all.map((name) => fs.statSync(path.join(PAGE, name)).size).reduce((a, b) => a + b, 0);
  console.log(`the page: ${bytes} bytes`);
  assert.ok(bytes <= 256_000, `${bytes} bytes`);
});

test('uPlot is that of its release 1.6.32', () => {
  const sha256 = (name) =>
    crypto
      .createHash('sha256')
      .update(fs.readFileSync(path.join(PAGE, name)))
      .digest('hex');
  assert.equal(sha256('uPlot.iife.min.js'), '19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f');
  assert.equal(sha256('uPlot.min.css'), 'df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04');
  assert.match(text('uPlot.LICENSE'), /MIT/);
});

test('lines have at most 120 characters', () => {
  const long = own.flatMap((name) =>
    text(name)
      .split('\n')
      .map((line, i) => [`${name}:${i + 1}`, line.length]),
  );
  assert.deepEqual(
    long.filter(([, length]) => length > 120),
    [],
  );
});

test('types hold', () => {
  const tsc = path.join(import.meta.dirname, 'node_modules/typescript/bin/tsc');
  try {
    execFileSync(process.execPath, [tsc, '--noEmit', '--checkJs', '-p', import.meta.dirname], { encoding: 'utf8' });
  } catch (error) {
    assert.fail(error.stdout);
  }
});

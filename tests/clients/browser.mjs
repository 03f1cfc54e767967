// Bundles a page for one engine and opens it in headless Chromium with software GL. It knows no glTF.
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { existsSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { build, stop } from 'esbuild';
import { chromium } from 'playwright-core';
import { serve } from './server.mjs';

const HERE = path.dirname(fileURLToPath(import.meta.url));

// Software GL gives the same pixels on every run; the rest keeps Chromium from calling out on a closed network.
const FLAGS = [
  '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader',
  '--ignore-gpu-blocklist',
  '--disable-quic',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
  '--disable-dev-shm-usage',
  '--force-color-profile=srgb',
];

/** A page must have its engine by then: seconds alone, more on a busy machine. */
const START_LIMIT_MS = 120_000;

function chromiumPath() {
  const found = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser'].find((p) => p && existsSync(p));
  if (!found) throw new Error('no Chromium found: install the package `chromium`, or set CHROMIUM to its path');
  return found;
}

/** Builds page/<engine>.mjs for each engine into `folder`. */
async function bundle(engines, folder) {
  await build({
    entryPoints: engines.map((engine) => path.join(HERE, 'page', `${engine}.mjs`)),
    outdir: folder,
    outExtension: { '.js': '.js' },
    bundle: true,
    format: 'esm',
    target: 'es2022',
    logLevel: 'error',
  });
  for (const engine of engines) {
    const html = `<!doctype html><meta charset="utf-8"><title>${engine}</title><body><script type="module" src="${engine}.js"></script>`;
    await writeFile(path.join(folder, `${engine}.html`), html);
  }
  await stop(); // its helper process would keep half a gigabyte
}

/** Headless Chromium with software GL. */
export function launch() {
  return chromium.launch({ executablePath: chromiumPath(), headless: true, chromiumSandbox: false, args: FLAGS, timeout: START_LIMIT_MS });
}

/** A server and a browser with the pages of `engines` ready to open. Call `close` at the end. */
export async function open(engines) {
  const folder = await mkdtemp(path.join(tmpdir(), 'lodbake-clients-'));
  await bundle(engines, folder);
  const server = await serve(folder);
  const browser = await launch();
  const modules = path.join(HERE, 'node_modules');
  const urls = {
    draco: `${server.url(path.join(modules, 'three/examples/jsm/libs/draco/gltf'))}/`,
    basis: `${server.url(path.join(modules, 'three/examples/jsm/libs/basis'))}/`,
    babylon: `${server.url(path.join(modules, '@babylonjs/core/assets'))}/`,
  };
  return {
    server,
    /** Opens a fresh page of `engine`; `onError(kind, text)` hears console errors, page errors and failed requests. */
    async page(engine, onError = () => {}) {
      const page = await browser.newPage();
      page.setDefaultTimeout(START_LIMIT_MS);
      page.on('console', (message) => {
        // Failed requests are heard below, with their status.
        if (message.type() === 'error' && !message.text().startsWith('Failed to load resource')) onError('console', message.text());
      });
      page.on('pageerror', (error) => onError('page', error.message));
      page.on('response', (response) => {
        if (response.status() >= 400 && !response.url().endsWith('/favicon.ico')) onError('http', `${response.status()} ${response.url()}`);
      });
      await page.goto(server.page(`${engine}.html`));
      await page.waitForFunction(() => globalThis.client !== undefined, null, { polling: 100 });
      await page.evaluate((where) => globalThis.client.start(where), urls);
      return page;
    },
    async close() {
      await browser.close();
      await server.close();
      await rm(folder, { recursive: true, force: true });
    },
  };
}

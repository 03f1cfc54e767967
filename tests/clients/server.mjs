// A static file server on the loopback interface, with byte ranges (Babylon.js streams a GLB level by level with them).
// It maps /<token>/fs/<absolute path> to the disk and /<token>/page/<name> to the pages built by browser.mjs; it knows no glTF.
import { createReadStream } from 'node:fs';
import { stat } from 'node:fs/promises';
import { createServer } from 'node:http';
import { randomBytes } from 'node:crypto';
import path from 'node:path';

const TYPES = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript',
  '.mjs': 'text/javascript',
  '.wasm': 'application/wasm',
  '.gltf': 'model/gltf+json',
  '.glb': 'model/gltf-binary',
  '.png': 'image/png',
  '.jpg': 'image/jpeg',
  '.jpeg': 'image/jpeg',
  '.webp': 'image/webp',
};

/** `bytes=a-b`, `bytes=a-`, `bytes=-n` → [start, end] inclusive; null when it cannot be satisfied. */
export function parseRange(header, size) {
  const match = /^bytes=(\d*)-(\d*)$/.exec(header);
  if (!match || (match[1] === '' && match[2] === '')) return null;
  const start = match[1] === '' ? Math.max(0, size - Number(match[2])) : Number(match[1]);
  const end = match[1] === '' || match[2] === '' ? size - 1 : Math.min(Number(match[2]), size - 1);
  return start <= end ? [start, end] : null;
}

/** Starts the server; `pages` is the folder behind /page/. */
export async function serve(pages) {
  // The token keeps other users of the machine from reading files through this port.
  const token = randomBytes(12).toString('hex');
  const locate = (url) => {
    const where = decodeURIComponent(new URL(url, 'http://localhost').pathname);
    if (where.startsWith(`/${token}/fs/`)) return where.slice(token.length + 4);
    if (where.startsWith(`/${token}/page/`)) return path.join(pages, path.basename(where));
    return null;
  };

  const answer = async (request, response) => {
    const file = locate(request.url);
    const facts = file && (await stat(file).catch(() => null));
    if (!facts?.isFile()) return response.writeHead(404).end();
    const headers = {
      'content-type': TYPES[path.extname(file).toLowerCase()] ?? 'application/octet-stream',
      'accept-ranges': 'bytes',
      'cache-control': 'no-store',
    };
    let span = [0, facts.size - 1];
    let status = 200;
    if (request.headers.range) {
      span = parseRange(request.headers.range, facts.size);
      if (!span) return response.writeHead(416, { 'content-range': `bytes */${facts.size}` }).end();
      headers['content-range'] = `bytes ${span[0]}-${span[1]}/${facts.size}`;
      status = 206;
    }
    headers['content-length'] = Math.max(0, span[1] - span[0] + 1);
    response.writeHead(status, headers);
    if (request.method === 'HEAD' || facts.size === 0) return response.end();
    createReadStream(file, { start: span[0], end: span[1] }).on('error', () => response.destroy()).pipe(response);
  };

  const server = createServer((request, response) => {
    answer(request, response).catch(() => response.writeHead(500).end());
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const base = `http://127.0.0.1:${server.address().port}/${token}`;
  const segments = (file) => path.resolve(file).split(path.sep).map(encodeURIComponent).join('/');
  return {
    /** The address of a built page. */
    page: (name) => `${base}/page/${name}`,
    /** The address of a file on disk. */
    url: (file) => `${base}/fs${segments(file)}`,
    /** `text` without what differs from run to run and from folder to folder. */
    anonymous: (text) => text.replaceAll(base, ''),
    close: () => new Promise((done) => (server.closeAllConnections(), server.close(done))),
  };
}

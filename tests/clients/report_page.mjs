// A report page as its readers use it: sorts, filters, goes by keyboard, in light and dark, and turns the distance slider
// of the live view. Knows the page, not how it was made.
import { mkdir } from 'node:fs/promises';
import path from 'node:path';
import { pathToFileURL } from 'node:url';
import { launch } from './browser.mjs';

const LIMIT_MS = 60_000;

/** [what, is it so, more] for each check. */
export async function checkPage(file, pictures) {
  const found = [];
  const judge = (what, isTrue, more = '') => found.push([`page: ${what}`, Boolean(isTrue), String(more)]);
  const browser = await launch();
  try {
    const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
    page.setDefaultTimeout(LIMIT_MS);
    const errors = [];
    const outside = [];
    page.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
    page.on('pageerror', (error) => errors.push(error.message));
    page.on('request', (request) => /^(file|data|blob):/.test(request.url()) || outside.push(request.url()));
    await page.goto(pathToFileURL(file).href);
    const shot = async (name, options = {}) => {
      if (!pictures) return;
      await mkdir(pictures, { recursive: true });
      await page.screenshot({ path: path.join(pictures, `${name}.png`), ...options });
    };
    await shot('light');
    judge('the worst finding is first', (await page.locator('#findings tbody tr').first().textContent()).includes('boulder.glb'));

    const column = (number) => page.locator(`#table tbody tr:not([hidden]) td:nth-child(${number})`).allTextContents();
    const numbers = async (number) => (await column(number)).map((text) => Number(text.replaceAll(',', ''))).filter((n) => !Number.isNaN(n));
    const ordered = (list, sign) => list.every((n, i) => i === 0 || sign * (n - list[i - 1]) >= 0);
    const head = (name) => page.getByRole('button', { name, exact: true });
    await head('triangles').click();
    judge('sorts upwards', ordered(await numbers(4), 1) && (await page.locator('th[aria-sort=ascending]').count()) === 1);
    await head('triangles').click();
    judge('sorts downwards', ordered(await numbers(4), -1) && (await page.locator('th[aria-sort=descending]').count()) === 1);
    await head('d_RMS').click();
    const looks = await column(7);
    judge('puts what has no value last', looks.at(-1) === '–' && looks[0] !== '–', looks.slice(0, 3));

    const all = (await column(1)).length;
    await page.getByLabel('Filter').fill('VASE');
    const vases = await column(1);
    judge('filters by words', vases.length > 0 && vases.length < all && vases.every((name) => name.includes('vase')), vases.length);
    judge('tells how many are shown', (await page.getByRole('status').textContent()) === `${vases.length} of ${all} levels`);
    await page.getByLabel('Filter').fill('');
    await page.getByLabel('Show').selectOption('error');
    const failing = await column(1);
    judge('filters by state', failing.length > 0 && failing.length < all);
    await page.getByLabel('Show').selectOption('');

    // By keyboard alone: the first stop skips to the table, every control can be reached and shows that it is.
    await page.reload();
    await page.keyboard.press('Tab');
    judge('the first stop skips the top', (await page.evaluate(() => document.activeElement.className)) === 'skip');
    await page.keyboard.press('Enter');
    const reached = new Set();
    for (let i = 0; i < 200 && reached.size < 10; i++) {
      await page.keyboard.press('Tab');
      const where = await page.evaluate(() => {
        const active = document.activeElement;
        const outline = getComputedStyle(active).outlineStyle;
        return outline === 'none' ? '' : active.id || active.textContent.slice(0, 20);
      });
      if (where === 'triangles') {
        await page.keyboard.press('Enter');
        judge('sorts by keyboard', (await page.locator('th[aria-sort=ascending]').textContent()) === 'triangles');
        reached.add(where);
        break;
      }
      if (where) reached.add(where);
    }
    judge('controls are reached by keyboard', reached.has('filter') && reached.has('state') && reached.has('triangles'), [...reached]);

    // What a screen reader needs: names for all controls and pictures, headings in order, headers of columns.
    const unnamed = await page.evaluate(() => [...document.querySelectorAll('button,input,select,img,svg[role=img],[role=region]')].filter((e) => {
      const label = e.labels?.[0]?.textContent || e.textContent || e.getAttribute('aria-label') || e.alt;
      return !label?.trim();
    }).length);
    judge('every control and picture has a name', unnamed === 0, unnamed);
    const depths = await page.evaluate(() => [...document.querySelectorAll('h1,h2,h3')].map((h) => Number(h.tagName[1])));
    judge('headings go down step by step', depths[0] === 1 && depths.every((d, i) => i === 0 || d <= depths[i - 1] + 1), depths);

    for (const scheme of ['light', 'dark']) {
      await page.emulateMedia({ colorScheme: scheme });
      const contrast = await page.evaluate(() => {
        const luminance = (color) => {
          const [r, g, b] = color.match(/[\d.]+/g).slice(0, 3).map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
          return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        };
        const ground = getComputedStyle(document.body).backgroundColor;
        const worst = [...document.querySelectorAll('h1,p,td,th button,dt,dd,figcaption,.error,.warning,.plain,a')].map((e) => {
          const style = getComputedStyle(e);
          const behind = style.backgroundColor === 'rgba(0, 0, 0, 0)' ? ground : style.backgroundColor;
          const [a, b] = [luminance(style.color), luminance(behind)].sort((x, y) => y - x);
          return (a + 0.05) / (b + 0.05);
        });
        return { worst: Math.min(...worst), isDark: luminance(ground) < 0.2 };
      });
      judge(`${scheme}: text has enough contrast`, contrast.worst >= 4.5, contrast.worst);
      judge(`${scheme}: the ground is ${scheme}`, contrast.isDark === (scheme === 'dark'));
    }
    await page.evaluate(() => scrollTo(0, 0));
    await shot('dark');
    await page.emulateMedia({ colorScheme: 'light' });
    await page.locator('#plots').scrollIntoViewIfNeeded();
    await shot('plots');
    await page.locator('#assets article').first().scrollIntoViewIfNeeded();
    await shot('asset');

    const view = page.locator('.view').first();
    await view.getByRole('button').click();
    const slider = view.getByRole('slider');
    await slider.waitFor();
    const state = () => view.evaluate((e) => ({ level: Number(e.dataset.highest), triangles: Number(e.dataset.triangles) }));
    await page.waitForFunction(() => document.querySelector('.view').dataset.triangles > 0);
    const near = await state();
    await shot('view-near');
    const seen = [near];
    await slider.focus();
    for (const value of [250, 500, 750, 1000]) {
      await slider.fill(String(value));
      seen.push(await state());
    }
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('End');
    const far = await state();
    await shot('view-far');
    judge('close by the source is shown', near.level === 0, JSON.stringify(seen));
    judge('further away come coarser levels', far.level > 1 && far.triangles < 0.5 * near.triangles, JSON.stringify(seen));
    judge('levels and triangles go one way', ordered(seen.map((s) => s.level), 1) && ordered(seen.map((s) => s.triangles), -1), JSON.stringify(seen));
    judge('nothing is asked from outside', outside.length === 0, outside);
    judge('no error in the console', errors.length === 0, errors.join('; '));

    await page.setViewportSize({ width: 390, height: 800 });
    const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    await page.evaluate(() => scrollTo(0, 0));
    await shot('narrow');
    judge('a narrow screen does not scroll sideways', overflow <= 0, overflow);
  } finally {
    await browser.close();
  }
  return found;
}

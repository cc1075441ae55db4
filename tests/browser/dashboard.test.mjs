// The dashboard in a real browser, on a real server with real jobs.
//
// REMESHD and REMESH are the programs, DATA a folder with surfaces, SCREENSHOTS where pictures go.
import assert from 'node:assert/strict';
import { copyFileSync, mkdirSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { after, afterEach, before, beforeEach, test } from 'node:test';
import { chromium } from 'playwright-core';

import { TestServer } from './server.mjs';

const { DATA, SCREENSHOTS, CHROMIUM = '/usr/bin/chromium' } = process.env;
const axeSource = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const aorta = join(DATA, 'aorta.stl');
// For what takes a second or two on an idle machine.
const patience = 90_000;
const hostileName = '<img src=x onerror="window.hacked=1">.stl';
const hostileLabel = '</span><script>window.hacked=1</script>';

let browser;
let server;
let page;
let problems;

before(async () => {
    mkdirSync(SCREENSHOTS, { recursive: true });
    browser = await chromium.launch({
        executablePath: CHROMIUM,
        args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-dev-shm-usage', '--disable-gpu-compositing'],
    });
    server = new TestServer();
    await server.start();
});

after(async () => {
    await browser?.close();
    await server?.remove();
    // For whoever reads why something failed.
    console.log(server?.log);
});

beforeEach(async () => {
    page = await openPage();
});

afterEach(async () => {
    await page.context().close();
    assert.deepEqual(problems, [], 'the console stays silent');
});

/** A page that counts what goes wrong in it. */
async function openPage(options = {}) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, reducedMotion: 'reduce', ...options });
    const opened = await context.newPage();
    opened.setDefaultTimeout(patience);
    problems = [];
    opened.on('pageerror', (error) => problems.push(String(error)));
    opened.on('console', (message) => {
        // A server that is away is no fault of the page.
        if (message.type() === 'error' && !/Failed to load resource|ERR_/.test(message.text())) {
            problems.push(message.text());
        }
    });
    opened.on('dialog', (dialog) => {
        if (dialog.type() === 'confirm') {
            void dialog.accept();
        } else {
            problems.push(`dialog: ${dialog.message()}`);
            void dialog.dismiss();
        }
    });
    return opened;
}

const picture = (name) => page.screenshot({ path: join(SCREENSHOTS, `${name}.png`), fullPage: true, animations: 'disabled' });

async function useTheme(theme) {
    await page.getByLabel('Colours').selectOption(theme);
}

/** What axe finds serious. What isn't a matter of colours is the same in both themes. */
async function assertAccessible(what) {
    for (const theme of ['light', 'dark']) {
        await useTheme(theme);
        if (!(await page.evaluate(() => 'axe' in globalThis))) {
            await page.evaluate(axeSource);
        }
        const options = theme === 'light' ? {} : { runOnly: ['color-contrast'] };
        const { violations } = await page.evaluate((chosen) => globalThis.axe.run(document, { resultTypes: ['violations'], ...chosen }), options);
        const serious = violations
            .filter(({ impact }) => impact === 'serious' || impact === 'critical')
            .map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).slice(0, 3).join(' ')}`);
        assert.deepEqual(serious, [], `${what}, ${theme}`);
        await picture(`${what}-${theme}`);
    }
}

/** Drops a file on the window, as a person does. */
async function drop(path, name) {
    const bytes = readFileSync(path).toString('base64');
    await page.evaluate(
        ([base64, fileName]) => {
            const data = new DataTransfer();
            data.items.add(new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], fileName));
            for (const type of ['dragenter', 'dragover', 'drop']) {
                document.body.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true, cancelable: true }));
            }
        },
        [bytes, name],
    );
}

const state = (name) => page.locator('.sub .state', { hasText: name }).waitFor();
const iteration = async () =>
    Number(/iteration ([\d,]+)/.exec(await page.locator('#curves-title + .muted').innerText())?.[1].replaceAll(',', '') ?? 0);

async function waitUntil(condition, what) {
    for (const end = Date.now() + patience; Date.now() < end; await page.waitForTimeout(50)) {
        if (await condition()) {
            return;
        }
    }
    assert.fail(`never: ${what}`);
}

test('an empty queue explains itself', async () => {
    await page.goto(server.url);
    await page.getByText('Nothing to do').waitFor();

    await assertAccessible('empty');
});

test('a surface that is dropped becomes a mesh while one watches', async () => {
    await page.goto(server.url);
    await page.getByText('Nothing to do').waitFor();
    await drop(aorta, hostileName);
    await page.getByText(hostileName).waitFor();
    await page.getByLabel('Edge length').fill('2.5');
    await page.getByText('More options').click();
    await page.getByLabel('Note, shown with the job').fill(hostileLabel);
    await assertAccessible('new');
    await page.getByRole('button', { name: 'Remesh' }).click();

    await state('succeeded');
    await page.getByRole('link', { name: 'Open report' }).waitFor();
    assert.ok((await iteration()) > 10, 'the curves hold the whole run');
    assert.ok(await page.getByText('before mean').first().isVisible());
    assert.ok(await page.getByText('open boundary').first().isVisible());
    assert.equal(await page.locator('h1').innerText(), hostileName);
    assert.ok(await page.getByText(hostileLabel).first().isVisible());
    assert.equal(await page.evaluate(() => globalThis.hacked), undefined);
    await page.locator('canvas[data-ready=yes]').waitFor();
    await assertAccessible('job');
});

test('the view turns, cuts and changes its colours', async () => {
    await page.goto(server.url);
    await page.getByRole('link', { name: hostileName }).click();
    const canvas = page.locator('canvas[data-ready=yes]');
    await canvas.waitFor();
    const looks = [];
    const look = async () => {
        await page.waitForTimeout(150);
        looks.push((await canvas.screenshot()).toString('base64'));
    };

    await look();
    const box = await canvas.boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + 120, box.y + box.height / 2 + 30, { steps: 4 });
    await page.mouse.up();
    await look();
    await canvas.press('ArrowRight');
    await look();
    await page.getByLabel('Colour by').selectOption('edge');
    await look();
    await page.getByLabel('What is shown').getByText('Tetrahedra').click();
    await page.getByText(/[\d,]+ tetrahedra/).waitFor();
    await page.getByLabel('Share that is cut away').fill('0.5');
    await page.getByLabel('Colour by').selectOption('quality');
    await look();
    await picture('tetrahedra-cut');

    assert.equal(new Set(looks).size, looks.length, 'every step changes the picture');
});

test('a report opens by itself and runs nothing', async () => {
    await page.goto(server.url);
    await page.getByRole('link', { name: hostileName }).click();
    const opening = page.waitForEvent('popup');
    await page.getByRole('link', { name: 'Open report' }).click();
    const report = await opening;
    await report.getByText('Quality before and after').waitFor();

    assert.equal(await report.locator('h1').innerText(), hostileName);
    const pictures = await report.locator('.pictures img').evaluateAll((images) => images.map((image) => image.naturalWidth));
    assert.equal(pictures.length, 3);
    assert.ok(pictures.every((width) => width > 50), 'pictures before, after and cut');
    assert.equal(await report.locator('script').count(), 0);
    await report.screenshot({ path: join(SCREENSHOTS, 'report.png'), fullPage: true });
});

test('a page goes on after the server restarted, and cancels', async () => {
    const path = await server.submit(aorta, '--edge-length', '0.7', '--format', 'vtu');
    await page.goto(server.url + path);
    await state('running');
    await waitUntil(async () => (await iteration()) > 3, 'convergence');
    const before = await iteration();
    await waitUntil(async () => (await iteration()) > before, 'more iterations');
    await picture('running');

    await server.stop();
    await page.getByText('Connection lost').waitFor();
    await server.start();
    await page.locator('.link-live').waitFor();
    await state('running');
    await waitUntil(async () => (await iteration()) > 0, 'convergence after the restart');

    await page.getByRole('button', { name: 'Cancel' }).click();
    await state('cancelled');

    await page.getByRole('button', { name: 'Retry' }).click();
    await page.waitForURL((url) => url.pathname.startsWith('/jobs/') && url.pathname !== path);
    await page.getByRole('button', { name: 'Cancel' }).click();
    await state('cancelled');
    assert.equal(await page.getByRole('link', { name: /^tenants\// }).getAttribute('href'), path, 'it names the job that it repeats');

    await page.goto(server.url);
    const cancelled = page.getByRole('row').filter({ hasText: 'aorta.stl' }).getByText('cancelled');
    await waitUntil(async () => (await cancelled.count()) === 2, 'both jobs in the queue, cancelled');
    await assertAccessible('queue');
});

test('coordinates say what they mean', async () => {
    const path = await server.submit(aorta, '--edge-length', '5', '--unit', 'mm', '--space', 'lps');
    await page.goto(server.url + path);
    await state('succeeded');
    await page.locator('canvas[data-ready=yes]').waitFor();

    await page.getByText('lengths in mm; h is the edge length, 5 mm').waitFor();
    await page.getByLabel('Cut along').selectOption('z, to the head');
    await page.getByLabel('Share that is cut away').fill('0.5');
    await page.getByText(/^z = −?[\d.,]+ mm$/).waitFor();
    await page.getByLabel('Colour by').selectOption('edge');
    await page.getByText('½ h, 2.5 mm').waitFor();
    const opening = page.waitForEvent('popup');
    await page.getByRole('link', { name: 'Open report' }).click();
    await (await opening).getByText('coordinates are LPS').waitFor();
});

test('a bound that is not met leaves drafts and says so', async () => {
    const path = await server.submit(aorta, '--edge-length', '5', '--min-dihedral', '60');
    await page.goto(server.url + path);
    await state('failed');

    await page.getByText('min_dihedral is').waitFor();
    await page.getByText('The files are drafts').waitFor();
    await page.getByRole('link', { name: /aorta.vtu draft, tetrahedra/ }).waitFor();
    await picture('bound-not-met');
});

test('a file that is no surface says what is wrong and what helps', async () => {
    const path = await server.submit(join(DATA, 'README.md'), '--format', 'stl', '--input-format', 'stl');
    await page.goto(server.url + path);
    await state('failed');

    await page.getByText('INVALID_INPUT').waitFor();
    await page.getByText('Export the surface again').waitFor();
    await picture('failed');
});

test('who has no token signs in, sees their own, and signs out', async () => {
    const guarded = new TestServer('--auth');
    try {
        await guarded.start();
        const token = await guarded.token('--tenant', 'radiology');
        const viewer = await guarded.token('--tenant', 'radiology', '--role', 'viewer');
        const stranger = await guarded.token('--tenant', 'surgery');
        const path = await guarded.submitAs(token, aorta, '--edge-length', '6', '--format', 'stl');
        const signIn = async (secret) => {
            await page.getByLabel('Token').fill(secret);
            await page.getByRole('button', { name: 'Sign in' }).click();
        };

        await page.goto(guarded.url + path);
        await page.getByRole('heading', { name: 'Sign in' }).waitFor();
        assert.equal(await page.getByText('aorta.stl').count(), 0, 'nothing is shown before');
        await assertAccessible('sign-in');
        await signIn('x'.repeat(43));
        await page.getByRole('alert').waitFor();
        await signIn(token);
        await page.getByRole('heading', { name: 'aorta.stl' }).waitFor();
        await state('succeeded');
        assert.equal(await page.evaluate(() => document.cookie), '', 'scripts see no cookie');
        await page.reload();
        await page.getByRole('heading', { name: 'aorta.stl' }).waitFor();

        await page.getByRole('button', { name: 'Sign out' }).click();
        await page.getByRole('heading', { name: 'Sign in' }).waitFor();
        assert.equal((await page.request.get(`${guarded.url}/api/v1/jobs`)).status(), 401);

        await signIn(viewer);
        await page.getByRole('link', { name: 'aorta.stl' }).click();
        await page.getByRole('button', { name: 'Delete' }).click();
        await page.getByRole('alert').waitFor();
        await page.getByRole('button', { name: 'Sign out' }).click();

        await signIn(stranger);
        await page.getByText('Nothing to do').waitFor();
        await page.goto(guarded.url + path);
        await page.getByRole('heading', { name: 'No such job' }).waitFor();
    } finally {
        await guarded.remove();
    }
});

test('an operator sees how tenants share the server, and no jobs but its own', async () => {
    const guarded = new TestServer('--auth');
    try {
        await guarded.start();
        const radiology = await guarded.token('--tenant', 'radiology');
        const operator = await guarded.token('--tenant', 'computing', '--role', 'operator');
        await guarded.submitAs(await guarded.token('--tenant', 'surgery'), aorta, '--edge-length', '7', '--format', 'stl');
        const own = await guarded.submitAs(operator, aorta, '--edge-length', '8', '--format', 'ply', '--label', 'mine=yes');
        await guarded.submitAs(radiology, aorta, '--edge-length', '6', '--format', 'stl');
        const signIn = async (secret) => {
            await page.getByLabel('Token').fill(secret);
            await page.getByRole('button', { name: 'Sign in' }).click();
        };
        const numbers = async (tenant) => (await page.locator('.by-tenant tbody tr', { hasText: tenant }).innerText()).split(/\s+/);
        const jobs = page.locator('.jobs tbody tr');

        await page.goto(guarded.url);
        await signIn(operator);
        await page.getByRole('group', { name: 'Show tenants' }).waitFor();
        for (const tenant of ['computing', 'radiology', 'surgery']) {
            // Name, running, waiting, longest wait, succeeded.
            await waitUntil(async () => (await numbers(tenant))[4] === '1', `the job of ${tenant} counts`);
        }
        assert.equal(await jobs.count(), 1);
        assert.ok((await jobs.innerText()).includes('mine: yes'));
        await assertAccessible('tenants');
        await page.getByRole('group', { name: 'Show tenants' }).getByText('surgery').click();
        await page.getByText('An operator sees the numbers of surgery').waitFor();
        assert.equal(await jobs.count(), 0);
        assert.match(await page.locator('.throughput').innerText(), /succeeded\s+1/);

        await page.getByRole('button', { name: 'Sign out' }).click();
        await signIn(radiology);
        await page.getByRole('link', { name: 'aorta.stl' }).waitFor();
        assert.equal(await page.getByRole('group', { name: 'Show tenants' }).count(), 0);
        assert.equal(await page.getByText('surgery').count(), 0);
        const { tenants } = await (await page.request.get(`${guarded.url}/api/v1/queue`)).json();
        assert.deepEqual(tenants.map(({ tenant }) => tenant), ['radiology']);
        await page.goto(guarded.url + own);
        await page.getByRole('heading', { name: 'No such job' }).waitFor();
    } finally {
        await guarded.remove();
    }
});

test('a phone shows all of it without scrolling sideways', async () => {
    await page.context().close();
    page = await openPage({ viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true });
    for (const address of ['/', '/new']) {
        await page.goto(server.url + address);
        await page.locator('h1').waitFor();
        const spare = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(spare <= 0, `${address} is ${spare} px too wide`);
        await picture(`phone-${address.slice(1) || 'queue'}`);
    }
    await page.goto(server.url);
    await page.getByRole('link', { name: hostileName }).click();
    await page.locator('canvas[data-ready=yes]').waitFor();
    assert.ok((await page.evaluate(() => document.documentElement.scrollWidth - innerWidth)) <= 0);
    await picture('phone-job');
});

test('nothing from elsewhere is loaded, and other sites are kept out', async () => {
    const response = await page.goto(server.url);
    assert.match(response.headers()['content-security-policy'], /default-src 'none'; script-src 'self'/);

    const foreign = await page.request.post(`${server.url}/api/v1/jobs`, { data: {} });
    assert.equal(foreign.status(), 403, 'a form of another site has no header of ours');
    const rebound = await page.request.get(server.url, { headers: { Host: 'evil.example' } });
    assert.equal(rebound.status(), 421, 'a name that someone else controls');
});

test('a long queue shows what runs, what was done, and older jobs when asked', async () => {
    const done = await server.submit(aorta, '--edge-length', '6', '--format', 'stl');
    await page.goto(server.url + done);
    await state('succeeded');
    const running = await server.submit(aorta, '--edge-length', '0.6', '--format', 'vtu', '--label', 'which=slow');
    await page.goto(server.url + running);
    await state('running');
    const headers = { 'X-Remesh': '1' };
    const { spec } = await (await page.request.get(`${server.url}/api/v1/${server.nameOf(done)}`)).json();
    for (let i = 0; i < 100; ++i) {
        // Equal jobs are answered from the first one's result.
        await page.request.post(`${server.url}/api/v1/jobs`, { headers, data: { spec } });
    }

    await page.goto(server.url);
    await page.getByRole('row').filter({ hasText: 'which: slow' }).getByText('running').waitFor();
    const rows = page.locator('.jobs tbody tr');
    assert.equal(await rows.count(), 101, 'the newest, and the one that runs');
    assert.ok((await rows.first().innerText()).includes('which: slow'), 'it comes first');
    await page.getByRole('button', { name: 'Show older jobs' }).click();
    await waitUntil(async () => (await rows.count()) > 103, 'older jobs');

    const canvases = page.locator('.throughput canvas');
    assert.equal(await canvases.count(), 2);
    const succeeded = Number(/succeeded\s+(\d+)/.exec(await page.locator('.throughput').innerText())[1]);
    assert.ok(succeeded > 100, 'all of them count');
    await page.locator('.throughput summary').click();
    assert.ok((await page.locator('.throughput tbody tr').count()) >= 1);
    await assertAccessible('queue-long');

    await page.goto(server.url + running);
    await page.getByRole('button', { name: 'Cancel' }).click();
    await state('cancelled');
});

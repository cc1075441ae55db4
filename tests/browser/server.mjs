// A server of the tests' own, on ports of its own, that can be stopped and started again.
import { spawn, execFile } from 'node:child_process';
import { mkdtempSync, readFileSync, existsSync, rmSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';

const { REMESHD, REMESH } = process.env;

async function freePort() {
    const socket = createServer();
    await new Promise((resolve) => socket.listen(0, '127.0.0.1', resolve));
    const { port } = socket.address();
    await new Promise((resolve) => socket.close(resolve));
    return port;
}

export class TestServer {
    directory = mkdtempSync(join(tmpdir(), 'remesh-browser.'));
    process = null;
    log = '';

    /** \param options  further flags of `remeshd serve` */
    constructor(...options) {
        this.options = options;
    }

    /** Fixed ports: a page that was open finds the server again. */
    async start() {
        this.http ??= await freePort();
        this.grpc ??= await freePort();
        const ready = join(this.directory, 'port');
        rmSync(ready, { force: true });
        this.process = spawn(
            REMESHD,
            ['serve', '--data-dir', join(this.directory, 'data'), '--listen', `127.0.0.1:${this.grpc}`,
             '--http', `127.0.0.1:${this.http}`, '--port-file', ready, '--threads', '1', ...this.options],
            { stdio: ['ignore', 'ignore', 'pipe'] },
        );
        this.process.stderr.on('data', (text) => (this.log += text));
        this.process.on('exit', (code, signal) => (this.log += `exit ${code} ${signal}\n`));
        for (let waited = 0; !existsSync(ready); waited += 20) {
            if (this.process.exitCode !== null || waited > 30_000) {
                throw new Error(`the server didn't come up:\n${this.log}`);
            }
            await new Promise((resolve) => setTimeout(resolve, 20));
        }
        readFileSync(ready);
    }

    async stop() {
        if (this.process && this.process.exitCode === null) {
            const ended = new Promise((resolve) => this.process.once('exit', (code, signal) => resolve(signal ?? code)));
            this.process.kill('SIGTERM');
            const end = await ended;
            if (end !== 0) {
                throw new Error(`the server ended with ${end}:\n${this.log}`);
            }
        }
    }

    /** A token for a tenant, as its operator makes it. */
    async token(...options) {
        const { stdout } = await promisify(execFile)(REMESHD, ['admin', 'token', 'create', '--data-dir', join(this.directory, 'data'), ...options]);
        return stdout.trim().split('\n').at(-1);
    }

    async remove() {
        await this.stop();
        rmSync(this.directory, { recursive: true, force: true });
    }

    get url() {
        return `http://127.0.0.1:${this.http}`;
    }

    /** The API's name of the job of a path on the dashboard. */
    nameOf(path) {
        const [, , tenant, id] = path.split('/');
        return `tenants/${tenant}/jobs/${id}`;
    }

    /** Submits by the command line. \return the job's path on the dashboard */
    async submit(file, ...options) {
        return this.submitAs('', file, ...options);
    }

    /** The same with a token. */
    async submitAs(token, file, ...options) {
        const env = { ...process.env, ...(token ? { REMESH_TOKEN: token } : {}) };
        const { stdout } = await promisify(execFile)(REMESH, ['--server', `127.0.0.1:${this.grpc}`, 'submit', file, ...options], { env });
        const [, tenant, , id] = stdout.trim().split('/');
        return `/jobs/${tenant}/${id}`;
    }
}

/** The built site on localhost, and Chromium to look at it. */

import { existsSync } from "node:fs";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, join, normalize } from "node:path";
import { chromium } from "playwright-core";

/** The folder of the site; DEEPMUON_SITE names another one than docs/_build. */
export const SITE = process.env.DEEPMUON_SITE ?? new URL("../../../docs/_build", import.meta.url).pathname;

const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";
const QUIET = ["no-first-run", "disable-background-networking", "disable-component-update", "disable-sync"];

/** @type {Record<string, string>} */
const TYPES = {
    ".css": "text/css",
    ".html": "text/html",
    ".js": "text/javascript",
    ".json": "application/json",
    ".mjs": "text/javascript",
    ".wasm": "application/wasm",
};

/** @returns {Promise<{address: string, close: () => Promise<void>}>} */
export async function serveSite() {
    if (!existsSync(join(SITE, "live", "engine"))) {
        throw new Error(`${SITE} has no live page with an engine: build the site with python docs/make_site.py`);
    }
    const server = createServer(async (request, response) => {
        const path = normalize(new URL(request.url ?? "/", "http://localhost").pathname).replace(/\/$/, "/index.html");
        try {
            const content = await readFile(join(SITE, path));
            response
                .writeHead(200, { "Content-Type": TYPES[extname(path)] ?? "application/octet-stream" })
                .end(content);
        } catch {
            response.writeHead(404).end();
        }
    });
    await new Promise((listening) => server.listen(0, "127.0.0.1", () => listening(undefined)));
    const { port } = /** @type {import("node:net").AddressInfo} */ (server.address());
    return {
        address: `http://localhost:${port}/`,
        close: () =>
            new Promise((closed) => {
                server.close(() => closed());
                server.closeAllConnections();
            }),
    };
}

/**
 * A browser of its own, with nothing remembered.
 *
 * @param {import("playwright-core").BrowserContextOptions} [options]
 */
export async function openBrowser(options = {}) {
    const profile = await mkdtemp(join(tmpdir(), "deepmuon-chromium-"));
    const context = await chromium.launchPersistentContext(profile, {
        executablePath: CHROMIUM,
        args: ["no-sandbox", "disable-gpu", "disable-quic", ...QUIET].map((flag) => `--${flag}`),
        ...options,
    });
    return {
        context,
        close: async () => {
            await context.close();
            await rm(profile, { recursive: true, force: true, maxRetries: 5 });
        },
    };
}

/**
 * Keeps the live page, its engine and its models in the browser. kept_files.js, written when the site is built, names
 * them and the version: any change makes a new version, which is fetched whole before it replaces the old one.
 */

importScripts("kept_files.js");

const worker = /** @type {ServiceWorkerGlobalScope & {KEPT: {version: string, files: string[]}}} */ (
    /** @type {unknown} */ (self)
);
const { version, files } = worker.KEPT;
const { scope } = worker.registration;
const CACHE = `${scope} ${version}`;

worker.addEventListener("install", (event) => {
    event.waitUntil(keep().then(() => worker.skipWaiting()));
});

worker.addEventListener("activate", (event) => {
    event.waitUntil(forgetOlder().then(() => worker.clients.claim()));
});

worker.addEventListener("fetch", (event) => {
    if (event.request.method === "GET") event.respondWith(answer(event.request));
});

async function keep() {
    const cache = await caches.open(CACHE);
    await cache.addAll(files.map((file) => new Request(new URL(file, scope), { cache: "no-cache" })));
}

async function forgetOlder() {
    const older = (await caches.keys()).filter((name) => name.startsWith(`${scope} `) && name !== CACHE);
    await Promise.all(older.map((name) => caches.delete(name)));
}

/** @param {Request} request */
async function answer(request) {
    const cache = await caches.open(CACHE);
    const page = request.mode === "navigate" && request.url.split(/[?#]/)[0] === scope;
    const kept = await cache.match(page ? new URL("index.html", scope) : request);
    return kept ?? fetch(request);
}

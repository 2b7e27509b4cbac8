/**
 * Have the page kept in the browser, so that it works without a network.
 *
 * @param {HTMLElement} line says that it does
 */
export async function workOffline(line) {
    if (!("serviceWorker" in navigator)) return; // only on https and localhost
    const { serviceWorker } = navigator;
    const hadOne = serviceWorker.controller !== null;
    serviceWorker.oncontrollerchange = () => {
        line.textContent = hadOne
            ? "This page has changed since it was kept: load it again to see the new one."
            : "This page is kept in your browser: it works without a network.";
    };
    if (hadOne) line.textContent = "This page is kept in your browser: it works without a network.";
    try {
        await serviceWorker.register(new URL("service_worker.js", import.meta.url));
    } catch {
        line.textContent = "This page could not be kept in your browser: it needs the network.";
    }
}

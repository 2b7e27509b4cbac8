/**
 * Fetch a file of the site.
 *
 * @param {URL} url
 * @param {string} name what it is, for an error
 * @throws {Error} in words, if it can't be had
 */
export async function fetchFile(url, name) {
    const path = url.pathname.split("/").at(-1);
    let response;
    try {
        response = await fetch(url);
    } catch {
        throw new Error(`${name} (${path}) could not be fetched: is the network there?`);
    }
    if (!response.ok) {
        throw new Error(`${name} (${path}) could not be fetched: the site answers ${response.status}.`);
    }
    return response;
}

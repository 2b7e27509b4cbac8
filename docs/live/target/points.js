/**
 * Points that fill the latents' cube evenly, for integrals: a Kronecker sequence, always the same. Source of the steps:
 * M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences" (2018),
 * https://extremelearning.com.au/unreasonable-effectiveness-of-quasirandom-sequences/
 *
 * @param {number} number of points
 * @param {number} size numbers of each
 * @returns {Float32Array} all strictly inside (-1, 1), point by point
 */
export function evenPoints(number, size) {
    const root = rootOf(size);
    const steps = Array.from({ length: size }, (_, axis) => root ** -(axis + 1));
    const points = new Float32Array(number * size);
    for (let i = 0; i < points.length; i++) {
        const share = (0.5 + (1 + Math.floor(i / size)) * steps[i % size]) % 1;
        points[i] = Math.max(-INSIDE, Math.min(INSIDE, 2 * share - 1));
    }
    return points;
}

const INSIDE = 1 - 2 ** -24;

/**
 * The number above 1 whose power of size + 1 is 1 more than itself.
 *
 * @param {number} size
 */
function rootOf(size) {
    let root = 2;
    for (let i = 0; i < 64; i++) root = (1 + root) ** (1 / (size + 1));
    return root;
}

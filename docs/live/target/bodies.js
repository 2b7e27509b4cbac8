/**
 * Bodies that muons enter, centred on the origin: the formulas of docs/targets.md and docs/random_numbers.md.
 * Directions (u, v, w) are those of motion, z up, and w < 0; sizes are in metres.
 *
 * @typedef {object} Body
 * @property {number} height from its top to its foot
 * @property {number} reach the radius of a sphere that holds it
 * @property {number} largestArea to which a muon's chance of being taken is relative
 * @property {(u: number, v: number, w: number) => number} projectedArea of its shadow across a direction
 * @property {(u: number, v: number, w: number, a: number, b: number, c: number) => Place | undefined} enters where, by
 *     three uniform numbers inside (-1, 1); nothing if the muon misses it
 *
 * @typedef {[number, number, number]} Place
 */

const { abs, cos, hypot, max, PI, sign, sin, sqrt } = Math;

/** @implements {Body} */
export class Box {
    /**
     * @param {number} x
     * @param {number} y
     * @param {number} z
     */
    constructor(x, y, z) {
        this.halves = [x / 2, y / 2, z / 2];
        this.faces = [y * z, x * z, x * y];
        this.height = z;
        this.reach = hypot(...this.halves);
        this.largestArea = hypot(...this.faces);
    }

    /** @type {Body["projectedArea"]} */
    projectedArea(u, v, w) {
        const [acrossX, acrossY, acrossZ] = this.faces;
        return acrossX * abs(u) + acrossY * abs(v) + acrossZ * abs(w);
    }

    /** @type {Body["enters"]} */
    enters(u, v, w, a, b, c) {
        const [x, y, z] = this.halves;
        const [acrossX, acrossY, acrossZ] = this.faces;
        let left = ((1 + a) / 2) * this.largestArea;
        if ((left -= acrossZ * abs(w)) < 0) return [b * x, c * y, z];
        if ((left -= acrossX * abs(u)) < 0) return [-sign(u) * x, c * y, b * z];
        if ((left -= acrossY * abs(v)) < 0) return [b * x, -sign(v) * y, c * z];
        return undefined;
    }
}

/** @implements {Body} */
export class Cylinder {
    /**
     * @param {number} radius
     * @param {number} height
     */
    constructor(radius, height) {
        this.radius = radius;
        this.height = height;
        this.half = height / 2;
        this.top = PI * radius ** 2;
        this.side = 2 * radius * height;
        this.reach = hypot(radius, this.half);
        this.largestArea = hypot(this.top, this.side);
    }

    /** @type {Body["projectedArea"]} */
    projectedArea(u, v, w) {
        return this.top * abs(w) + this.side * hypot(u, v);
    }

    /** @type {Body["enters"]} */
    enters(u, v, w, a, b, c) {
        const { radius, half } = this;
        const sine = hypot(u, v);
        let left = ((1 + a) / 2) * this.largestArea;
        if ((left -= this.top * abs(w)) < 0) {
            const away = radius * sqrt((1 + c) / 2);
            return [away * cos(PI * b), away * sin(PI * b), half];
        }
        if ((left -= this.side * sine) >= 0) return undefined;
        const across = radius * b;
        const depth = radius * sqrt(1 - b * b); // against the direction
        return [-(across * v + depth * u) / sine, (across * u - depth * v) / sine, c * half];
    }
}

/** @implements {Body} */
export class Sphere {
    /** @param {number} radius */
    constructor(radius) {
        this.radius = this.reach = radius;
        this.height = 2 * radius;
        this.largestArea = PI * radius ** 2;
    }

    projectedArea() {
        return this.largestArea;
    }

    /**
     * On the disc across the direction, whose axes are those of J. Duff et al., "Building an Orthonormal Basis,
     * Revisited", JCGT 6 (2017) 1, and from there back to the surface.
     *
     * @type {Body["enters"]}
     */
    enters(u, v, w, _, b, c) {
        const squared = (1 + c) / 2;
        const away = sqrt(squared);
        const [first, second] = [away * cos(PI * b), away * sin(PI * b)];
        const along = 1 / (1 - w);
        const mixed = -u * v * along;
        const back = sqrt(max(0, 1 - squared));
        return [
            this.radius * (first * (1 - u * u * along) + second * mixed - back * u),
            this.radius * (first * mixed + second * (1 - v * v * along) - back * v),
            this.radius * (first * u + second * v - back * w),
        ];
    }
}

/** What a reader chooses among, with the sizes that a body is made of, in the order of the command's. */
export const KINDS = {
    box: { make: Box, sizes: ["Width along x", "Width along y", "Height"] },
    cylinder: { make: Cylinder, sizes: ["Radius", "Height"] },
    sphere: { make: Sphere, sizes: ["Radius"] },
};

/** @typedef {keyof typeof KINDS} Kind */

/**
 * @param {Kind} kind
 * @param {number[]} sizes in metres
 * @returns {Box | Cylinder | Sphere}
 */
export function bodyOf(kind, sizes) {
    const make = /** @type {new (...sizes: number[]) => Box | Cylinder | Sphere} */ (KINDS[kind].make);
    return new make(...sizes);
}

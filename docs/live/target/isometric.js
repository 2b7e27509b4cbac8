/**
 * Bodies in an isometric drawing, seen from above, from where x and y are large: x runs down to the right, y down to
 * the left, z up. A metre along each of them is a metre of the drawing.
 */

import { Box, Cylinder, Sphere } from "./bodies.js";

const { PI, cos, sin, sqrt } = Math;

/** How much larger than life what lies across the view is. */
export const ENLARGED = sqrt(3 / 2);

const ARCS = 64; // corners of a circle

/** @typedef {import("./bodies.js").Place} Place */

/**
 * @typedef {object} Outline
 * @property {Place[][]} seen lines on the sides that are seen, corner by corner
 * @property {Place[][]} hidden lines behind them
 */

/**
 * Where a place is in the drawing, in metres to the right and down.
 *
 * @param {Place} place
 * @returns {[number, number]}
 */
export function projected([x, y, z]) {
    return [((x - y) * sqrt(3)) / 2, (x + y) / 2 - z];
}

/**
 * Whether a place on a body's surface is on a side that is seen.
 *
 * @param {Box | Cylinder | Sphere} body
 * @param {Place} place
 */
export function isSeen(body, [x, y, z]) {
    if (body instanceof Sphere) return x + y + z > 0;
    if (body instanceof Cylinder) return x + y > 0 || isAt(z, body.half);
    const [halfX, halfY, halfZ] = body.halves;
    return isAt(x, halfX) || isAt(y, halfY) || isAt(z, halfZ);
}

/**
 * Whether a coordinate of float32 is that of a face.
 *
 * @param {number} coordinate
 * @param {number} face
 */
function isAt(coordinate, face) {
    return coordinate >= face * (1 - 1e-6);
}

/**
 * @param {Box | Cylinder | Sphere} body
 * @returns {Outline}
 */
export function outlineOf(body) {
    if (body instanceof Box) return ofBox(body);
    return body instanceof Cylinder ? ofCylinder(body) : ofSphere(body);
}

/**
 * @param {Box} box
 * @returns {Outline}
 */
function ofBox({ halves: [x, y, z] }) {
    return {
        seen: [
            [
                [x, y, z],
                [-x, y, z],
                [-x, -y, z],
                [x, -y, z],
                [x, y, z],
                [x, y, -z],
            ],
            [
                [-x, y, z],
                [-x, y, -z],
                [x, y, -z],
                [x, -y, -z],
                [x, -y, z],
            ],
        ],
        hidden: [
            [
                [-x, -y, z],
                [-x, -y, -z],
                [x, -y, -z],
            ],
            [
                [-x, -y, -z],
                [-x, y, -z],
            ],
        ],
    };
}

/**
 * @param {Cylinder} cylinder
 * @returns {Outline}
 */
function ofCylinder({ radius, half }) {
    const [left, right] = [(3 / 4) * PI, -PI / 4]; // where its sides are seen edge on
    return {
        seen: [
            arc(0, 2 * PI, (angle) => [radius * cos(angle), radius * sin(angle), half]),
            arc(right, left, (angle) => [radius * cos(angle), radius * sin(angle), -half]),
            ...[left, right].map((angle) =>
                [half, -half].map((z) => /** @type {Place} */ ([radius * cos(angle), radius * sin(angle), z])),
            ),
        ],
        hidden: [arc(left, right + 2 * PI, (angle) => [radius * cos(angle), radius * sin(angle), -half])],
    };
}

/**
 * Its rim, and its equator.
 *
 * @param {Sphere} sphere
 * @returns {Outline}
 */
function ofSphere({ radius }) {
    const [acrossView, upInView] = [
        [1 / sqrt(2), -1 / sqrt(2), 0],
        [-1 / sqrt(6), -1 / sqrt(6), 2 / sqrt(6)],
    ];
    return {
        seen: [
            arc(0, 2 * PI, (angle) => {
                const [x, y, z] = acrossView.map((axis, i) => radius * (axis * cos(angle) + upInView[i] * sin(angle)));
                return [x, y, z];
            }),
            arc(-PI / 4, (3 / 4) * PI, (angle) => [radius * cos(angle), radius * sin(angle), 0]),
        ],
        hidden: [arc((3 / 4) * PI, (7 / 4) * PI, (angle) => [radius * cos(angle), radius * sin(angle), 0])],
    };
}

/**
 * @param {number} from
 * @param {number} to
 * @param {(angle: number) => Place} at
 * @returns {Place[]}
 */
function arc(from, to, at) {
    return Array.from({ length: ARCS + 1 }, (_, i) => at(from + ((to - from) * i) / ARCS));
}

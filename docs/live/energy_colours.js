/** The colours of muons in pictures, by their kinetic energies: warm are the slow ones. */

const COLOURS = ["#ff7a59", "#ffb85c", "#fff1c9", "#9fd3ff", "#5f9dff"]; // from 0.1, 1, 10, 100 GeV on

/**
 * How many powers of ten an energy is above 0.1 GeV, from 0 to 4.
 *
 * @param {number} energy in GeV
 */
export function decadesOf(energy) {
    return Math.max(0, Math.min(4, Math.log10(energy) + 1));
}

/** @param {number} energy in GeV */
export function colourOf(energy) {
    return COLOURS[Math.floor(decadesOf(energy))];
}

/** Muons as text, a line each: the columns of `deepmuon-convert`. */

export const CSV_HEADER = "kinetic_energy_GeV,u,v,w,pdg_id\n";

const MU_MINUS = 13; // and mu+ is -13

/**
 * @param {import("./tally.js").Muons} muons
 * @returns {string} the lines of the muons, without the header
 */
export function csvLines({ energy, direction, charge }) {
    const lines = [];
    for (let i = 0; i < energy.length; i++) {
        const numbers = [energy[i], direction[3 * i], direction[3 * i + 1], direction[3 * i + 2]];
        lines.push(`${numbers.map(shortest).join()},${-MU_MINUS * charge[i]}\n`);
    }
    return lines.join("");
}

/**
 * A float32 in nine digits, from which it can be had again exactly.
 *
 * @param {number} number
 */
function shortest(number) {
    return String(Number(number.toPrecision(9)));
}

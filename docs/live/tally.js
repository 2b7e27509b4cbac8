/**
 * What is counted of the muons as they are made.
 *
 * @typedef {object} Muons columns, as the model gives them
 * @property {Float32Array} energy kinetic, in GeV
 * @property {Float32Array} direction u, v, w of each muon
 * @property {Int8Array} charge
 */

const { abs, floor, min } = Math;

const EDGES = Array.from({ length: 71 }, (_, i) => 10 ** (i / 10 - 2));

/**
 * The bin of the least float32 whose upper 16 bits are these. Numbers that share them are within 1 % of each other, and
 * so in this bin or the next: a logarithm of each would take most of the time of counting.
 */
const BIN_OF_BITS = (() => {
    const least = new Float32Array(Uint32Array.from({ length: 1 << 15 }, (_, bits) => bits << 16).buffer);
    let bin = 0;
    return Uint8Array.from(least, (energy) => {
        while (energy >= EDGES[bin]) bin++;
        return bin;
    });
})();

/** Bins even in the logarithm of the kinetic energy, ten a decade from 10 MeV to 100 TeV; those to 1 TeV of docs/scores.md. */
export const EnergyBins = {
    count: 70,
    edges: EDGES,

    /**
     * @param {number} energy in GeV; gives 0 below and 71 above the bins
     * @param {number} bits of it as a positive float32
     */
    index: (energy, bits) => {
        const bin = BIN_OF_BITS[bits >>> 16];
        return energy >= EDGES[bin] ? bin + 1 : bin;
    },
};

/** Bins even in the cosine of the zenith angle: those of docs/scores.md. */
export const CosZenithBins = {
    count: 20,
    edges: Array.from({ length: 21 }, (_, i) => i / 20),

    /** @param {number} cosZenith */
    index: (cosZenith) => min(19, floor(20 * cosZenith)),
};

// The contract's 1e-6 on the length is twice that on its square, which rounding to float32 adds to.
const SQUARED_LENGTH_TOLERANCE = 2e-6 + 5e-7;

export class Tally {
    /**
     * @param {number} energyMin in GeV: below this, and above the next, an energy is unphysical
     * @param {number} energyMax
     */
    constructor(energyMin, energyMax) {
        this.energyMin = Math.fround(energyMin);
        this.energyMax = Math.fround(energyMax);
        this.count = 0;
        this.unphysical = 0;
        this.positive = 0;
        this.energySum = 0;
        this.by_energy = new Array(EnergyBins.count + 2).fill(0);
        this.by_cos_zenith = new Array(CosZenithBins.count).fill(0);
    }

    /** @param {Muons} muons */
    add({ energy, direction, charge }) {
        const bits = new Uint32Array(energy.buffer, energy.byteOffset, energy.length);
        for (let i = 0; i < energy.length; i++) {
            const w = direction[3 * i + 2];
            if (!this.isPhysical(energy[i], direction[3 * i], direction[3 * i + 1], w, charge[i])) {
                this.unphysical += 1;
                continue;
            }
            this.energySum += energy[i];
            this.positive += charge[i] > 0 ? 1 : 0;
            this.by_energy[EnergyBins.index(energy[i], bits[i])] += 1;
            this.by_cos_zenith[CosZenithBins.index(-w)] += 1;
        }
        this.count += energy.length;
    }

    /**
     * Whether a muon can be: the same demands as those of `deepmuon-check`. A NaN meets none.
     *
     * @param {number} energy
     * @param {number} u
     * @param {number} v
     * @param {number} w
     * @param {number} charge
     */
    isPhysical(energy, u, v, w, charge) {
        return (
            energy >= this.energyMin &&
            energy <= this.energyMax &&
            abs(u * u + v * v + w * w - 1) <= SQUARED_LENGTH_TOLERANCE &&
            w < 0 &&
            (charge === 1 || charge === -1)
        );
    }
}

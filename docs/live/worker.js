/** The worker, which makes muons while the page stays responsive. It answers what `engine.js` asks. */

import { Generator } from "./generator.js";
import { Run } from "./run.js";
import { Aim } from "./target/aim.js";
import { bodyOf } from "./target/bodies.js";

/** @type {Generator | undefined} */
let generator;
/** @type {Run} */
let run;
/** @type {Aim | undefined} */
let aim;

const answers = {
    /** @param {import("./models.js").Model} model */
    async open(model) {
        if (isOf(generator, model)) return;
        generator = await Generator.open(model);
    },

    /**
     * @param {number} number
     * @param {bigint} seed
     */
    start(number, seed) {
        if (!generator) throw new Error("No model is open.");
        run = new Run(generator, number, seed);
    },

    more: () => run.more(),

    /** @param {number} block */
    csv: (block) => run.csv(block),

    /**
     * The muons per second that hit a body, some of them, and what comes to its ends if that differs.
     *
     * @param {import("./models.js").Model} model a family at a depth
     * @param {import("./target/bodies.js").Kind} kind
     * @param {number[]} sizes in metres
     * @param {bigint} seed
     */
    async aim(model, kind, sizes, seed) {
        if (!aim || !isOf(aim.generator, model)) aim = await Aim.open(model);
        const body = bodyOf(kind, sizes);
        return { hz: aim.rate(body), hits: await aim.hits(body, seed), ends: await aim.ends(body) };
    },
};

/**
 * @param {Generator | undefined} generator
 * @param {import("./models.js").Model} model
 */
function isOf(generator, { sha256, depth_m }) {
    return generator?.model.sha256 === sha256 && generator.model.depth_m === depth_m;
}

/** @typedef {typeof answers} Answers */

self.onmessage = async ({ data: { id, question, details } }) => {
    try {
        const answer = await /** @type {any} */ (answers)[question](...details);
        self.postMessage({ id, answer });
    } catch (error) {
        self.postMessage({ id, error: error instanceof Error ? error.message : String(error) });
    }
};

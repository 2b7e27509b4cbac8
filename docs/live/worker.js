/** The worker, which makes muons while the page stays responsive. It answers what `engine.js` asks. */

import { Generator } from "./generator.js";
import { Run } from "./run.js";

/** @type {Generator | undefined} */
let generator;
/** @type {Run} */
let run;

const answers = {
    /** @param {import("./models.js").Model} model */
    async open(model) {
        const now = generator?.model;
        if (now?.sha256 === model.sha256 && now.depth_m === model.depth_m) return;
        const opened = await Generator.open(model);
        await generator?.close();
        generator = opened;
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
};

/** @typedef {typeof answers} Answers */

self.onmessage = async ({ data: { id, question, details } }) => {
    try {
        const answer = await /** @type {any} */ (answers)[question](...details);
        self.postMessage({ id, answer });
    } catch (error) {
        self.postMessage({ id, error: error instanceof Error ? error.message : String(error) });
    }
};

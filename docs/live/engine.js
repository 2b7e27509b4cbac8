/** The page's end of the worker: asks it, and waits for its answers. */

/** @typedef {import("./worker.js").Answers} Answers */

export class Engine {
    constructor() {
        /** @type {Map<number, {resolve: (answer: any) => void, reject: (error: Error) => void}>} */
        this.waiting = new Map();
        this.asked = 0;
        this.worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
        this.worker.onmessage = ({ data }) => this.settle(data);
        this.worker.onerror = () => this.fail("The page's worker failed: load the page again, or try a newer browser.");
    }

    /**
     * @template {keyof Answers} Question
     * @param {Question} question
     * @param {Parameters<Answers[Question]>} details
     * @returns {Promise<Awaited<ReturnType<Answers[Question]>>>}
     * @throws {Error} with what the worker said
     */
    ask(question, ...details) {
        const id = this.asked++;
        return new Promise((resolve, reject) => {
            this.waiting.set(id, { resolve, reject });
            this.worker.postMessage({ id, question, details });
        });
    }

    /** @param {{id: number, answer?: any, error?: string}} reply */
    settle({ id, answer, error }) {
        const { resolve, reject } = /** @type {NonNullable<ReturnType<typeof this.waiting.get>>} */ (
            this.waiting.get(id)
        );
        this.waiting.delete(id);
        if (error === undefined) resolve(answer);
        else reject(new Error(error));
    }

    /** @param {string} message */
    fail(message) {
        for (const { reject } of this.waiting.values()) reject(new Error(message));
        this.waiting.clear();
    }

    close() {
        this.worker.terminate();
    }
}

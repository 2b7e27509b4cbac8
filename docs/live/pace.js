/** How fast time goes in a moving picture: as it does, or faster where muons are rare. */

const FASTEST = 1000; // muons a second that a faster time may bring

/** @type {[string, number][]} */
const PACES = [
    ["real time", 1],
    ["a minute a second", 60],
    ["an hour a second", 3600],
    ["a day a second", 86400],
    ["a month a second", (365.25 / 12) * 86400],
    ["a year a second", 365.25 * 86400],
];

export class Pace {
    /**
     * @param {HTMLSelectElement} select
     * @param {() => void} changed is called when the reader chooses another
     */
    constructor(select, changed) {
        this.select = select;
        this.wanted = 1;
        this.most = 1;
        select.onchange = () => {
            this.wanted = Number(select.value);
            changed();
        };
    }

    /** Seconds of the muons' time that go by in one of the reader's. */
    get factor() {
        return Math.min(this.wanted, this.most);
    }

    /**
     * Offer what suits muons that come so often.
     *
     * @param {number} hz
     */
    offer(hz) {
        const fit = PACES.filter(([, factor]) => factor === 1 || factor * hz <= FASTEST);
        this.most = fit[fit.length - 1][1];
        this.select.replaceChildren(...fit.map(([name, factor]) => new Option(name, String(factor))));
        this.select.value = String(this.factor);
        const field = /** @type {HTMLElement} */ (this.select.closest(".field"));
        field.hidden = fit.length === 1;
    }
}

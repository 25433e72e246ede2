// The frames of the page: headers at once, returns and images when a frame is first shown.

import { bytesOf, columnsOf } from "./blocks.js";
import { Verdicts } from "./verdicts.js";

const MOST_KEPT = 48;

const textOf = (id) => document.getElementById(id)?.textContent ?? "";

export class Frames {
  constructor(headers) {
    this.headers = headers;
    this.kept = new Map();
  }

  /** The frame with its verdicts; decoded once, and kept while there is room. */
  async at(index) {
    if (!this.kept.has(index)) {
      if (this.kept.size >= MOST_KEPT) this.kept.delete(this.kept.keys().next().value);
      this.kept.set(index, await this.decoded(index));
    }
    return this.kept.get(index);
  }

  async decoded(index) {
    const header = this.headers[index];
    const columns = await columnsOf(bytesOf(textOf(`block-${index}`)));
    return {
      ...header,
      columns,
      image: textOf(`image-${index}`),
      verdicts: new Verdicts(columns, header.viewpoint, header.unexplained),
    };
  }

  /** Replace a frame by what the engine says from another viewpoint; camera and image stay. */
  async judged(index, { header, block }) {
    const frame = await this.at(index);
    const columns = await columnsOf(bytesOf(block));
    Object.assign(this.headers[index], header);
    const verdicts = new Verdicts(columns, header.viewpoint);
    return Object.assign(frame, header, { columns, verdicts, isMoved: true });
  }
}

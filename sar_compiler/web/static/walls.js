// The walls of a map, which labels avoid.

// Maximum number of pixels along each side; a larger map is reduced.
const MOST = 1024;
// The grey value from which a pixel is not a wall; unknown ground has 205 and free ground 254.
const LIGHT = 150;

export class Walls {
  /**
   * @param {object} map a map of the journal: an image whose pixels measure `resolution` metres.
   * @param {() => void} onLoaded called when the image is decoded. Before, the map has no walls.
   */
  constructor(map, onLoaded) {
    this.map = map;
    const image = new Image();
    image.addEventListener("load", () => {
      this.read(image);
      onLoaded();
    });
    image.src = `data:image/png;base64,${map.png}`;
  }

  /** Sum the darkness of all pixels to the left of and above each corner of a pixel. */
  read(image) {
    const reduced = Math.min(1, MOST / Math.max(image.width, image.height));
    const [width, height] = [image.width, image.height].map((each) => Math.max(1, Math.round(each * reduced)));
    const pen = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d", { willReadFrequently: true });
    pen.drawImage(image, 0, 0, width, height);
    const { data } = pen.getImageData(0, 0, width, height);
    const sums = new Float64Array((width + 1) * (height + 1));
    for (let row = 0; row < height; row += 1) {
      for (let column = 0, sum = 0; column < width; column += 1) {
        sum += Math.max(0, 1 - data[4 * (row * width + column)] / LIGHT);
        sums[(row + 1) * (width + 1) + column + 1] = sums[row * (width + 1) + column + 1] + sum;
      }
    }
    this.sums = { sums, width, height };
  }

  /** Return the area of the walls inside the bounds of some positions, in square metres. */
  within(positions) {
    if (!this.sums) return 0;
    const { x, y, yaw = 0, width, height, resolution } = this.map;
    const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
    const [across, down] = [this.sums.width / width / resolution, this.sums.height / height / resolution];
    const columns = positions.map(([px, py]) => ((px - x) * cos + (py - y) * sin) * across);
    const rows = positions.map(([px, py]) => this.sums.height - ((py - y) * cos - (px - x) * sin) * down);
    const [left, right, top, bottom] = [Math.min(...columns), Math.max(...columns), Math.min(...rows), Math.max(...rows)];
    return (this.sum(right, bottom) - this.sum(left, bottom) - this.sum(right, top) + this.sum(left, top)) / (across * down);
  }

  /** Return the darkness to the left of and above a position in pixels. Inside a pixel the sum grows linearly in both directions. */
  sum(column, row) {
    const { sums, width, height } = this.sums;
    const [c, r] = [Math.max(0, Math.min(width, column)), Math.max(0, Math.min(height, row))];
    const [left, top] = [Math.min(Math.floor(c), width - 1), Math.min(Math.floor(r), height - 1)];
    const at = (dc, dr) => sums[(top + dr) * (width + 1) + left + dc];
    const between = (dr) => at(0, dr) + (c - left) * (at(1, dr) - at(0, dr));
    return between(0) + (r - top) * (between(1) - between(0));
  }
}

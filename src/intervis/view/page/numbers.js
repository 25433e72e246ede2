// Numbers as intervis.sight.explanation prints them.

/** One decimal, rounded as Python rounds: exact ties go to the even digit. */
export function oneDecimal(value) {
  const quarters = 4 * value;
  if (Number.isInteger(quarters) && quarters % 2 !== 0) {
    const lower = Math.floor(10 * value);
    return ((lower + Math.abs(lower % 2)) / 10).toFixed(1);
  }
  return value.toFixed(1);
}

/** Whole decimetres of a length in metres. */
export function decimetres(metres) {
  return Math.round(10 * Number(oneDecimal(metres)));
}

/** A length in decimetres as text in metres, never 0.0. */
export function metresText(dm) {
  return dm === 0 ? "less than 0.1" : (dm / 10).toFixed(1);
}

/** A percentage by its code: 0 and 101 stand for less than 1 % and more than 99 %. */
export function percentText(code) {
  if (code === 0) return "less than 1 %";
  if (code === 101) return "more than 99 %";
  return `${code} %`;
}

/** Coordinates in decimetres as "(x, y, z)" in metres. */
export function placeText(dm) {
  return `(${dm.map((value) => (value / 10).toFixed(1)).join(", ")})`;
}

/** Thousands separated by commas. */
export function grouped(count) {
  return String(count).replace(/\B(?=(\d{3})+$)/g, ",");
}

/** Index of the number that is nearest to a value; -1 where there is none. */
export function nearestIndex(numbers, value) {
  let [best, least] = [-1, Infinity];
  for (let i = 0; i < numbers.length; i++) {
    const away = Math.abs(numbers[i] - value);
    if (away < least) [best, least] = [i, away];
  }
  return best;
}

// The target position of a node that is dropped, or moved with a key.

// Returns whether a drop on a node's box is before, in or after the node. The fraction is the position on the box, from 0 to 1.
export const dropSide = (fraction, canHold) => (fraction < (canHold ? 0.25 : 0.5) ? "before" : fraction > (canHold ? 0.75 : 0.5) ? "after" : "in");

// Returns the parent and the index for a drop; null if a node cannot be dropped on this side of the target. Nothing is dropped beside a tree.
export function dropPlace(elements, target, side) {
  const element = elements[target];
  if (side === "in") return { parent: target, index: element.children.length };
  return elements[element.parent]?.parent == null ? null : { parent: element.parent, index: element.index + (side === "after" ? 1 : 0) };
}

// Returns the parent and the index for a move with an arrow key: up or down among the siblings, left to after the parent, right
// into the previous sibling. Null if the move is impossible.
export function keyPlace(elements, number, key) {
  const { parent, index } = elements[number];
  const outer = elements[parent];
  if (key === "ArrowUp") return index > 0 ? { parent, index: index - 1 } : null;
  if (key === "ArrowDown") return index + 1 < outer.children.length ? { parent, index: index + 2 } : null;
  if (key === "ArrowLeft") return [outer, elements[outer.parent]].some((each) => !each || each.tag === "BehaviorTree") ? null : { parent: outer.parent, index: outer.index + 1 };
  if (index === 0) return null;
  const before = outer.children[index - 1];
  return { parent: before, index: elements[before].children.length };
}

const sizeOf = (elements, number) => elements[number].children.reduce((sum, each) => sum + sizeOf(elements, each), 1);

// Returns the number that an element will have after an operation: the new, changed or moved element, or a neighbour of the deleted one.
export function resultOf(elements, operation, { element, parent, index }) {
  if (operation === "duplicate") return element + sizeOf(elements, element);
  if (operation === "delete") {
    const around = elements[element].parent;
    const place = elements[element].index;
    const { children } = elements[around];
    return place + 1 < children.length ? element : (children[place - 1] ?? around);
  }
  if (parent === undefined) return element;
  const number = elements[parent].children[index] ?? parent + sizeOf(elements, parent);
  return element < number ? number - sizeOf(elements, element) : number;
}

// Endings of files.

/** Endings of files by what they hold. */
export const POINTS = ["ply", "xyz", "txt", "asc", "pts", "csv", "pcd", "las", "laz", "e57"];
export const MESHES = ["stl", "obj", "off", "3mf", "msh", "vtu", "inp"];
export const SOLIDS = ["step", "stp"];
export const endingOf = (name: string): string => name.toLowerCase().split(".").pop() ?? "";

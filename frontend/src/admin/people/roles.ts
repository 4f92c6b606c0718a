import type { Schemas } from "../api";

export type Role = Schemas["AccountOut"]["role"];
export const ROLES: Role[] = ["viewer", "experimenter", "owner"];

export function asRole(word: string | null): Role {
  return ROLES.find((role) => role === word) ?? "viewer";
}

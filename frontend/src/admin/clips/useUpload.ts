/** An upload of clips: what is sent, how far the server is with it, what became of each file. It outlives the page. */

import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { beginUpload, replaceFile, sendFiles } from "./sending";
import { type Tried, tryClips, withTried } from "./tried";

const LOOK_EVERY_MS = 700;
const keyOf = (purpose: string) => `palpebra.upload.${purpose}`;

export interface Upload {
  /** Files that are there, of those that are being sent; null where nothing is sent. */
  sending: { sent: number; of: number } | null;
  /** Why sending ended before its end; `goOn` takes it up again. */
  broken: Error | null;
  goOn: () => void;
  progress: Schemas["UploadProgress"] | null;
  /** What became of each file, once none waits. */
  received: Schemas["UploadOut"] | null;
  /** The same as it was last, while files are sent or looked into: what stands beside it need not go. */
  last: Schemas["UploadOut"] | null;
  /** Whether the clips that came play in this browser; null until all have been tried. */
  plays: "all" | "not all" | "unknown" | null;
  fps: number | null;
  askFps: (fps: number | null) => void;
  send: (files: readonly File[]) => void;
  /** Put a file in the place of one that was refused; the others stay. */
  replace: (name: string, file: File) => void;
  /** Why the last file was not taken. */
  notReplaced: Error | null;
  isReplacing: boolean;
  /** Leave a file out of what is made of the upload, or put it back. */
  leaveOut: (name: string, leftOut: boolean) => void;
  notLeftOut: Error | null;
  /** Begin anew; what was sent is deleted by the server within a day. */
  forget: () => void;
}

function playsOf({ data, isError }: { data: Tried | undefined; isError: boolean }): Upload["plays"] {
  if (isError || data?.canTell === false) return "unknown";
  if (data === undefined) return null;
  return data.problems.size > 0 ? "not all" : "all";
}

/** What keeps the clips from being used as they are; false where nothing does. */
export function playNeeded({ received, plays }: Upload): string | false {
  if (received === null || received.files.length === 0) return false;
  if (plays === null) return "clips that have been tried in this browser";
  return plays === "not all" && "another file for each clip that does not play, or leave it out";
}

/** The upload for this purpose, such as a new study; one that was begun before a reload is taken up. */
export function useUpload(purpose: string): Upload {
  const queries = useQueryClient();
  const [id, setId] = useState(() => localStorage.getItem(keyOf(purpose)));
  const [fps, setFps] = useState<number | null>(null);
  const [sending, setSending] = useState<Upload["sending"]>(null);
  const path = { params: { path: { upload: id ?? "" } } };
  const progress = useQuery({
    queryKey: ["upload", id, "progress"],
    queryFn: () => unwrap(api.GET("/api/admin/uploads/{upload}/progress", path)),
    enabled: id !== null,
    refetchInterval: ({ state }) => ((state.data?.waiting ?? 1) > 0 && state.error === null ? LOOK_EVERY_MS : false),
  });
  const settled = sending === null && progress.data?.waiting === 0 && progress.data.files + progress.data.left_out > 0;
  const received = useQuery({
    queryKey: ["upload", id, "files", progress.data?.files, progress.data?.left_out, fps],
    queryFn: () => unwrap(api.GET("/api/admin/uploads/{upload}", path)),
    enabled: id !== null && settled,
    placeholderData: (before, of) => (of?.queryKey[1] === id ? before : undefined),
  });
  const files = settled ? received.data?.files : undefined;
  const tried = useQuery({
    queryKey: ["tried", id, files?.map(({ name, sha256, fps: rate }) => [name, sha256, rate])],
    queryFn: ({ signal }) => tryClips(id ?? "", files ?? [], signal),
    enabled: id !== null && files !== undefined,
    staleTime: Infinity,
  });
  const forget = () => {
    localStorage.removeItem(keyOf(purpose));
    setId(null);
    setSending(null);
    send.reset();
    replaced.reset();
    left.reset();
  };
  const send = useMutation<undefined, Error, readonly File[]>({
    mutationFn: async (files) => {
      setSending({ sent: 0, of: files.length });
      const upload = id ?? (await beginUpload(fps)).id;
      localStorage.setItem(keyOf(purpose), upload);
      setId(upload);
      await sendFiles(upload, files, (sent) => setSending({ sent, of: files.length }));
    },
    onSettled: async () => {
      setSending(null);
      await queries.invalidateQueries({ queryKey: ["upload"] });
    },
  });
  const replaced = useMutation<Schemas["UploadProgress"], Error, { name: string; file: File }>({
    mutationFn: ({ name, file }) => replaceFile(id ?? "", name, file),
    onSuccess: async (told) => {
      queries.setQueryData(["upload", id, "progress"], told);
      queries.removeQueries({ queryKey: ["upload", id, "files"] });
      await queries.invalidateQueries({ queryKey: ["upload", id, "progress"] });
    },
  });
  const left = useMutation<Schemas["UploadProgress"], Error, { file: string; left_out: boolean }>({
    mutationFn: (body) => unwrap(api.PUT("/api/admin/uploads/{upload}/left-out", { ...path, body })),
    onSuccess: async (told) => {
      queries.setQueryData(["upload", id, "progress"], told);
      await queries.invalidateQueries({ queryKey: ["upload", id, "files"] });
    },
  });
  const ask = useMutation<Schemas["UploadProgress"], Error, number | null>({
    mutationFn: (asked) => unwrap(api.PUT("/api/admin/uploads/{upload}/frame-rate", { ...path, body: { fps: asked } })),
    onSuccess: () => queries.invalidateQueries({ queryKey: ["upload"] }),
  });
  // An upload that the server has deleted, or that is somebody else's, is none.
  const gone = progress.error !== null;
  return {
    sending,
    broken: send.error,
    goOn: () => send.variables !== undefined && send.mutate(send.variables),
    progress: id === null || gone ? null : (progress.data ?? null),
    received: settled && !gone && received.data ? withTried(received.data, tried.data) : null,
    last: id === null || gone || !received.data ? null : withTried(received.data, tried.data),
    plays: playsOf(tried),
    fps: received.data?.fps ?? fps,
    askFps: (asked) => {
      setFps(asked);
      if (id !== null && !gone) ask.mutate(asked);
    },
    send: (files) => {
      if (gone) forget();
      send.mutate(files);
    },
    replace: (name, file) => replaced.mutate({ name, file }),
    notReplaced: replaced.error,
    isReplacing: replaced.isPending,
    leaveOut: (file, left_out) => left.mutate({ file, left_out }),
    notLeftOut: left.error,
    forget,
  };
}

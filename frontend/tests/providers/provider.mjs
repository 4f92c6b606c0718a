// A real OpenID provider for tests: `node provider.mjs '{"clients": [...], "accounts": {...}}'`.
// Prints {"issuer": ...} once it listens. Who signs in says so in the address of the interaction (?as=NAME), or is "always".
// POST /test/logout {"sub": ...} answers with the logout token that it sends for a subject, `how` spoils it.
// POST /test/spoil {"how": ...} makes the next ID token a forged one, as an attacker or a broken provider would.
import { createHmac, generateKeyPairSync, sign } from "node:crypto";
import { createServer } from "node:http";
import Provider from "oidc-provider";

const { clients, accounts, always } = JSON.parse(process.argv[2] ?? "{}");
const { privateKey } = generateKeyPairSync("rsa", { modulusLength: 2048 });
const stranger = generateKeyPairSync("rsa", { modulusLength: 2048 }).privateKey;
const jwk = { ...privateKey.export({ format: "jwk" }), kid: "test", use: "sig", alg: "RS256" };

const encoded = (value) => Buffer.from(JSON.stringify(value)).toString("base64url");
const decoded = (part) => JSON.parse(Buffer.from(part, "base64url").toString());

/** A token with other claims, signed with the provider's own key, or as said. */
function forged(token, claims, { alg = "RS256", key = privateKey } = {}) {
  const head = encoded(alg === "none" ? { alg } : { ...decoded(token.split(".")[0]), alg });
  const body = encoded({ ...decoded(token.split(".")[1]), ...claims });
  return `${head}.${body}.${signature(alg, `${head}.${body}`, key)}`;
}

function signature(alg, text, key) {
  if (alg === "none") return "";
  if (alg === "HS256") return createHmac("sha256", clients[0].client_secret).update(text).digest("base64url");
  return sign("RSA-SHA256", Buffer.from(text), key).toString("base64url");
}

const now = () => Math.floor(Date.now() / 1000);
const SPOILERS = {
  nonce: (token) => forged(token, { nonce: "another" }),
  "no nonce": (token) => forged(token, { nonce: undefined }),
  "alg none": (token) => forged(token, {}, { alg: "none" }),
  "client's secret": (token) => forged(token, {}, { alg: "HS256" }),
  audience: (token) => forged(token, { aud: "another-client" }),
  "two audiences": (token) => forged(token, { aud: ["another-client", decoded(token.split(".")[1]).aud], azp: "another-client" }),
  expired: (token) => forged(token, { exp: now() - 600, iat: now() - 1200 }),
  "from the future": (token) => forged(token, { iat: now() + 3600, exp: now() + 7200 }),
  issuer: (token) => forged(token, { iss: "https://another.example" }),
  signature: (token) => forged(token, {}, { key: stranger }),
  "no subject": (token) => forged(token, { sub: undefined }),
  "no event": (token) => forged(token, { events: { "https://another.example/event": {} } }),
  "with a nonce": (token) => forged(token, { nonce: "n" }),
  old: (token) => forged(token, { iat: now() - 600, exp: now() + 600 }),
};

const server = createServer();
server.listen(0, "127.0.0.1", () => {
  const issuer = `http://127.0.0.1:${server.address().port}`;
  let spoiler = null;
  let logout = null;
  const provider = new Provider(issuer, {
    clients: clients.map((client) => ({ ...client, backchannel_logout_uri: `${issuer}/test/logged-out` })),
    jwks: { keys: [jwk] },
    cookies: { keys: ["for tests"] },
    pkce: { required: () => true },
    claims: { openid: ["sub"], profile: ["name", "preferred_username", "groups"], acr: null, amr: null },
    acrValues: ["two-factors"],
    features: { devInteractions: { enabled: false }, claimsParameter: { enabled: true }, backchannelLogout: { enabled: true } },
    // Its guard against addresses of the own machine is in the dispatcher; its clients listen here.
    fetch: (url, options) => fetch(url, { ...options, dispatcher: undefined }),
    interactions: { url: (_ctx, interaction) => `/interaction/${interaction.uid}` },
    findAccount: (_ctx, id) => (id in accounts ? { accountId: id, claims: () => ({ sub: id, ...accounts[id] }) } : undefined),
    async loadExistingGrant(ctx) {
      const grant = new ctx.oidc.provider.Grant({ clientId: ctx.oidc.client.clientId, accountId: ctx.oidc.session.accountId });
      grant.addOIDCScope("openid profile");
      await grant.save();
      return grant;
    },
  });
  provider.use(async (ctx, next) => {
    await next();
    if (spoiler !== null && ctx.oidc?.route === "token" && ctx.body?.id_token) {
      ctx.body.id_token = SPOILERS[spoiler](ctx.body.id_token);
      spoiler = null;
    }
  });
  const callback = provider.callback();
  async function logoutToken(sub, how) {
    const sent = new Promise((resolve) => (logout = resolve));
    const client = await provider.Client.find(clients[0].client_id);
    await client.backchannelLogout(sub, "a session");
    const token = await sent;
    return how === null ? token : SPOILERS[how](token);
  }
  server.on("request", (request, response) => {
    const address = new URL(request.url, issuer);
    if (address.pathname === "/test/spoil") {
      spoiler = address.searchParams.get("how");
      response.writeHead(spoiler in SPOILERS ? 204 : 400).end();
    } else if (address.pathname === "/test/logged-out") {
      request.setEncoding("utf8").on("data", (body) => logout(new URLSearchParams(body).get("logout_token")));
      request.on("end", () => response.writeHead(200).end());
    } else if (address.pathname === "/test/logout") {
      logoutToken(address.searchParams.get("sub"), address.searchParams.get("how")).then(
        (token) => response.writeHead(200).end(token),
        (error) => response.writeHead(500).end(String(error)),
      );
    } else if (address.pathname.startsWith("/interaction/")) {
      const { as = always, amr, acr } = Object.fromEntries(address.searchParams);
      const login = { accountId: as, ...(amr && { amr: amr.split(" ") }), ...(acr && { acr }) };
      const result = as === undefined ? { error: "access_denied" } : { login };
      provider.interactionFinished(request, response, result, { mergeWithLastSubmission: false });
    } else callback(request, response);
  });
  console.log(JSON.stringify({ issuer }));
});

"""The clients of the declared providers: one each, for what they keep of them."""

from server.providers.protocol import ProviderClient
from server.settings import Settings


class Providers:
    """One client a declared provider; to each the browser comes back at an address of its own."""

    def __init__(self, settings: Settings) -> None:
        self._clients = {
            name: ProviderClient(
                provider, f"{settings.public_url}/api/admin/session/providers/{name}/callback"
            )
            for name, provider in settings.oidc.items()
        }

    def of(self, provider_id: str) -> ProviderClient:
        """The client of a declared provider."""
        return self._clients[provider_id]

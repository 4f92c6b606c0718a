"""Motion checks: clips whose content is defined by motion alone, or by the order of what happens."""

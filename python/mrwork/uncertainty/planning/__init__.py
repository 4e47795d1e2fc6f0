"""The next test: which of many would narrow a band most."""

"""Telemetry where shops look for it: an MTConnect adapter, MQTT, webhooks, mDNS (docs/telemetry.md)."""

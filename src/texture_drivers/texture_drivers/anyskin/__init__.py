"""AnySkin and ReSkin, magnetic skins over magnetometers."""

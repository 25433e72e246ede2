"""Siting: where to put roadside scanners or cameras so that they see what matters."""

"""Many scans reconstructed, in processes of this computer or on a cluster."""

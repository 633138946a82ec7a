"""`check` prints estimated beside configured noise, and the section and key to write."""

import json

from adhesion_can.cli.main import main


def test_check_prints_both_noises_and_the_key_to_write(tmp_path, capsys):
    log, config, result = tmp_path / "a.log", tmp_path / "loud.toml", tmp_path / "c.json"
    config.write_text("[sensors]\nvehicle_speed_std = 0.1\n", encoding="utf-8")
    assert main(["simulate", "--scenario", "wet", "--duration", "8", "--log", str(log)]) == 0
    capsys.readouterr()
    assert main(["check", str(log), "--config", str(config), "--json", str(result)]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "vehicle speed" in out
    assert "WARNING: vehicle speed: noise of 0.0" in out
    assert "write vehicle_speed_std = 0.0" in out
    assert "under [sensors]" in out
    assert "verdict: usable" in out
    document = json.loads(result.read_text(encoding="utf-8"))
    assert document["noise"]["vehicle_speed_std"]["configured"] == 0.1
    assert 0.008 < document["noise"]["vehicle_speed_std"]["std"] < 0.012
    assert len(document["warnings"]) == 1

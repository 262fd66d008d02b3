within LeakingChamber.Effects;
model GaugeOffset "a pressure sensor with a wrong zero"
  extends Common.Signals.Offset(offset(unit="Pa", min=-1e5, max=1e5));
  annotation (
    __Workbench(effect(
      size="offset", matters=2e3, slots={"gauge"},
      separation="its reading in the open air")),
    Documentation(info="<html>
<p>It shows only where the flow depends on the pressure. 20 mbar are 0.2 % of a range of 10 bar.</p>
</html>"));
end GaugeOffset;

within AirSupply.Effects;
model SensorOffset "a pressure sensor whose zero is wrong"
  extends Common.Signals.Offset(offset(unit="Pa", min=-1e5, max=1e5));
  annotation (
    __Workbench(effect(
      size="offset", matters=5e3,
      slots={"sensor"},
      separation="the reading of the empty reservoir")),
    Documentation(info="<html>
<p>A wrong zero, which laws that depend on the pressure feel.</p>
</html>"));
end SensorOffset;

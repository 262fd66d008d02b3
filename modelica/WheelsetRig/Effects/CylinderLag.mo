within WheelsetRig.Effects;
model CylinderLag "Pads that lag behind the measured pressure"
  extends Brakes.PartialCylinder;
  extends Common.Signals.Lag(
    u=pB, lag(max=0.2), window(min=1e-3), past(unit="Pa", nominal=1e5));
equation
  p = y;
  rest = restBefore;
  annotation (
    __Workbench(effect(
      size="lag", matters=0.003,
      separation="a sine on the pressure at constant speed")),
    Documentation(info="<html>
<p>10 to 100 ms between sensor and cylinder are usual.</p>
<h4>Limits</h4>
<p>No dead time. The cylinder is empty at the start.</p>
</html>"));
end CylinderLag;

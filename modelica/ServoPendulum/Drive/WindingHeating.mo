within ServoPendulum.Drive;
model WindingHeating "A winding whose resistance grows as it heats"
  extends PartialResistance;
  parameter Real rise(unit="1/J", min=0.0, max=0.02) = 0.0 "Relative growth per heat that it holds";
  parameter Real tau(unit="s", min=2.0, max=100.0) = 10.0 "Time in which heat leaves it";
  Real heat(unit="J", start=0.0, fixed=true, nominal=10.0) "Of the winding, above its start";
equation
  der(heat) = u*current^2 - heat/tau;
  y = u*(1.0 + rise*heat);
  annotation (
    __Workbench(effect(
      size="rise", matters=1e-3, shapes(tau={3.0, 30.0}),
      separation="the current with the shaft blocked, at once and after ten seconds")),
    Documentation(info="<html>
<p>Copper gains 0.39 % per kelvin; a winding of 2 g holds 0.8 J per kelvin, which is 0.005 per joule,
and hands it on within 2 to 30 s.
What the servo reports as its temperature is that of its board or case.</p>
</html>"));
end WindingHeating;

within WheelsetRig.Effects;
model ReturnSpringPressure "A stiffer return spring"
  extends Brakes.PartialCylinder;
  parameter Units.Pressure increase(min=-0.2e5, max=0.3e5) = 0.0
    "Of the pressure of the return spring";
equation
  p = pB - increase;
  rest = restBefore;
  annotation (
    __Workbench(effect(
      size="increase", matters=500.0,
      separation="the pressure of first contact, read at standstill")),
    Documentation(info="<html>
<p><code>p = pB - increase</code>: a constant loss of force while the pads touch. The contact
pressure is 0.1 to 0.4 bar.</p>
</html>"));
end ReturnSpringPressure;

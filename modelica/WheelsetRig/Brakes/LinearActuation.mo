within WheelsetRig.Brakes;
model LinearActuation "Normal force proportional to pressure above that of the return spring"
  extends PartialActuation;
  parameter Real kappa(unit="N/Pa", min=0) = 0.1086 "Force per pressure: pads x area x ratio x efficiency";
  parameter Units.Pressure p0(min=0) = 25000.0 "Pressure that balances the return spring";
equation
  Fperp = kappa*noEvent(max(0.0, pB - p0));
  annotation (Documentation(info="<html>
<p>Two pads, cylinder of 254 cm2 (7 inch), lever ratio 2.25, efficiency 0.95: 10.86 kN/bar.</p>
</html>"));
end LinearActuation;

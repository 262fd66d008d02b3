within WheelsetRig.Contact;
function frictionCoefficient "Friction that falls with slip velocity"
  input Units.Velocity w "Slip velocity";
  input Units.FrictionCoefficient mu0 "Friction at zero slip velocity";
  input PolachParameters polach;
  output Units.FrictionCoefficient mu;
algorithm
  mu := mu0*((1.0 - polach.A)*exp(-polach.B*abs(w)) + polach.A);
  annotation (Documentation(info="<html>
<p>Polach (2005), equation (3).</p>
</html>"));
end frictionCoefficient;

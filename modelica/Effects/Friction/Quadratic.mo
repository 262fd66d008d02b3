within Effects.Friction;
model Quadratic "Drag that grows with the square of the velocity"
  extends Interfaces.Friction;
  parameter Real drag(unit="N.s2/m2", min=0.0) = 0.0 "Drag per square of the velocity";
equation
  f = drag*v*abs(v);
  annotation (Documentation(info="<html>
<p><code>f = drag*v*|v|</code>: windage and turbulent flow, after I. Newton.</p>
</html>"));
end Quadratic;

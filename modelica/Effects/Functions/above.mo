within Effects.Functions;
function above "What of x is above 0, with a rounded kink"
  input Real x;
  input Real width "Over which the kink is rounded, in the unit of x";
  output Real y;
algorithm
  y := 0.5*(x + sqrt(x^2 + width^2));
  annotation (Documentation(info="<html>
<p><code>(x + sqrt(x^2 + width^2))/2</code>: <code>width/2</code> at 0, and off by
<code>width^2/(4*|x|)</code> far from it. <code>above(x, w) - above(-x, w) = x</code>.</p>
</html>"));
end above;

within CascadedTanks.Functions;
function root "Square root of a level, smooth where the level is zero or below"
  input Real h(unit="V") "Level";
  output Real y(unit="1") "Root of the level over 1 V, with the sign of h";
protected
  constant Real h0(unit="V") = 0.01 "Level below which the outlet is laminar";
algorithm
  y := h/sqrt(sqrt(h^2 + h0^2));
  annotation (Documentation(info="<html>
<p><code>h/(h^2 + h0^2)^(1/4)</code>: the square root but for <code>(h0/(2*h))^2</code> of it, with a
finite slope at zero, where the flow through a hole is laminar.</p>
</html>"));
end root;

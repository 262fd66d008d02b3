within CascadedTanks.Functions;
function above "What of x is above 0, with a rounded kink"
  input Real x;
  input Real width = 0.05 "Over which the kink is rounded, in the unit of x";
  output Real y;
algorithm
  y := 0.5*(x + sqrt(x^2 + width^2));
end above;

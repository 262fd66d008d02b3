within TrainRig;
package Slots "Partial models by which slots are constrained, and their null versions"
  annotation (Documentation(info="<html>
<p>A slot holds the values of all axles, bogies or vehicles; an effect in it has a size for each of
them. The number <code>n</code> has the default of a train of two vehicles.</p>
</html>"));
end Slots;

within HeatedHouse;
package Interfaces "Partial models by which slots are constrained"
end Interfaces;
